// The first frame of a classifier, before any pose is published.

#include <gtest/gtest.h>

#include <cmath>

#include "adapters/adapters.h"
#include "fleet/fleet.h"
#include "tests/unit/services/on_fake_bus/stage_bench.h"

namespace omnifleet {
namespace {

constexpr double kCamera_m = 0.5;

/// A fully visible disc: the silhouette of its foot and top on the floor (docs/methods/local_mapper.md).
ObjectObservation disc(const Eigen::Vector2d& centre, double radius, double height) {
  ObjectObservation object;
  const double scale = kCamera_m / (kCamera_m - height);
  for (int k = 0; k < SupportFunction::kDirections; ++k) {
    const double phi = 2.0 * M_PI * k / SupportFunction::kDirections;
    const double g = radius + centre.dot(Eigen::Vector2d(std::cos(phi), std::sin(phi)));
    object.supports.b_m.push_back(static_cast<float>(g < 0.0 ? g : scale * g));
    object.supports.sigma_m.push_back(0.003f);
    object.hull_m.push_back(centre + radius * Eigen::Vector2d(std::cos(phi), std::sin(phi)));
    object.hull_m.back() *= object.hull_m.back().norm() < centre.norm() ? 1.0 : scale;
  }
  object.contact_m = (1.0 - radius / centre.norm()) * centre;
  object.centroid_m = centre;
  return object;
}

TEST(ClassifierFirstFrame, ClassifiesObjectAtInitialPoseAsRobotInFirstFrame) {
  const std::string file = std::string(std::getenv("OMNIFLEET_SOURCE_DIR")) + "/config/fleets/small.yaml";
  const fleet::Fleet fleet = fleet::Fleet::load(file, {}, {});
  const auto &r1 = fleet.robot("r1"), &r2 = fleet.robot("r2");
  const Eigen::Vector2d start = (r1.initial_pose->inverse() * *r2.initial_pose).translation();
  test::StageBench bench("classifier", "r1");
  auto maps = bench.bus().writer(bench.topics.local_map, "r1");
  auto objects = bench.bus().reader(bench.topics.objects, "r1");
  LocalMap map;
  map.robot = "r1";
  map.acquired_ns = 1'000'000'000;
  map.state = FrameState::kOk;
  map.camera_height_m = kCamera_m;
  // An object of the same shape on the opposite side is not a robot of the fleet.
  map.objects = {disc(-start, r2.body.radius_m, r2.body.height_m),
                 disc(start, r2.body.radius_m, r2.body.height_m)};
  for (std::uint16_t k = 0; k < 2; ++k) map.objects[k].label = static_cast<std::uint16_t>(k + 1);
  v1::LocalMap wire;
  adapters::toWire(map, adapters::RunClock::kSim, wire);
  ASSERT_TRUE(maps->write(wire));
  bench.spin();
  v1::Objects out;
  ASSERT_TRUE(objects->take(out));
  ASSERT_EQ(out.tracks().size(), 2U);
  for (const v1::Track& track : out.tracks()) {
    const bool is_robot = Eigen::Vector2d(track.position().x(), track.position().y()).dot(start) > 0.0;
    EXPECT_EQ(track.kind() == v1::ObjectKind::OBJECT_ROBOT, is_robot);
  }
}

}  // namespace
}  // namespace omnifleet
