// Surfaces that were there for a short time only, by exact scans of polygons.
#include "scan/transients.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "tests/unit/scan/room_scans.h"

namespace omnifleet::scan {
namespace {

using testing::Scene;

constexpr double kTransientSigma = 0.003;  // 1/m, of the inverse range: 1 cm at 1.8 m

Polygon bodyAt(const Eigen::Vector2d& place) {
  const double r = 0.15;
  return {{place.x() - r, place.y() - r},
          {place.x() + r, place.y() - r},
          {place.x() + r, place.y() + r},
          {place.x() - r, place.y() + r}};
}

/// Scans from a short path on which another robot drives past on the other side of the room.
struct Encounter {
  std::vector<LineScan> scans;
  std::vector<Pose2> poses;

  /// @param moving false: the other robot stands still
  explicit Encounter(bool moving) {
    std::mt19937 random(3);
    for (int k = 0; k < 6; ++k) {
      Scene scene = testing::furnishedRoom();
      scene.outlines.push_back(bodyAt(place(moving ? k : 0)));
      poses.push_back({-1.2 + 0.3 * k, 0.3, 0.4 * k});
      scans.emplace_back();
      scans.back().fit(scene.scan(poses.back(), kTransientSigma, random));
    }
  }
  static Eigen::Vector2d place(int k) { return {1.2 - 0.5 * k, -1.3}; }

  std::vector<Reference> references(std::size_t count) const {
    std::vector<Reference> all;
    for (std::size_t i = 0; i < count; ++i) all.push_back({&scans[i], poses[i]});
    return all;
  }
  /// Compared beams of a scan that end within 5 cm of the other robot's place at that time, or elsewhere; and
  /// how many of them are transient.
  struct Count {
    int body = 0, transient_body = 0, rest = 0, transient_rest = 0;
  };
  Count count(const Transients& transients, std::size_t scan, const Eigen::Vector2d& body) const {
    Count n;
    const std::size_t stride = scans[scan].beams().size() / static_cast<std::size_t>(OverlapOptions{}.beams);
    for (std::size_t i = 0; i < scans[scan].beams().size(); i += stride) {
      const LineScan::Beam& beam = scans[scan].beams()[i];
      if (!beam.has_line) continue;
      const Eigen::Vector2d at = poses[scan] * beam.point_m.cast<double>();
      const bool hits = (at - body).cwiseAbs().maxCoeff() < 0.2, transient = transients.of(scan)[i] != 0;
      ++(hits ? n.body : n.rest);
      if (transient) ++(hits ? n.transient_body : n.transient_rest);
    }
    return n;
  }
};

TEST(Transients, ARobotThatDrivesPastIsTransient) {
  const Encounter encounter(true);
  Transients transients;
  transients.update(encounter.references(encounter.scans.size()));
  int body = 0, found = 0;
  for (std::size_t k = 0; k < encounter.scans.size(); ++k) {
    const Encounter::Count n = encounter.count(transients, k, Encounter::place(static_cast<int>(k)));
    body += n.body;
    found += n.transient_body;
    EXPECT_EQ(n.transient_rest, 0) << "scan " << k << ": walls and furniture are not transient";
    EXPECT_GT(n.rest, 60);
  }
  EXPECT_GT(body, 12);
  EXPECT_GE(found, body * 9 / 10) << found << " of " << body;
}

TEST(Transients, ARobotThatStandsStillIsNot) {
  const Encounter encounter(false);
  Transients transients;
  transients.update(encounter.references(encounter.scans.size()));
  for (std::size_t k = 0; k < encounter.scans.size(); ++k) {
    const Encounter::Count n = encounter.count(transients, k, Encounter::place(0));
    EXPECT_GT(n.body, 0);
    EXPECT_EQ(n.transient_body + n.transient_rest, 0) << "scan " << k;
  }
}

TEST(Transients, OneScanAloneSaysNothing) {
  const Encounter encounter(true);
  Transients transients;
  transients.update(encounter.references(1));
  const Encounter::Count n = encounter.count(transients, 0, Encounter::place(0));
  EXPECT_GT(n.body, 0);
  EXPECT_EQ(n.transient_body + n.transient_rest, 0);
}

TEST(Transients, ScansOneByOneGiveTheSameAsAllAtOnce) {
  const Encounter encounter(true);
  Transients at_once, one_by_one;
  at_once.update(encounter.references(encounter.scans.size()));
  for (std::size_t count = 1; count <= encounter.scans.size(); ++count)
    one_by_one.update(encounter.references(count));
  ASSERT_EQ(one_by_one.size(), at_once.size());
  for (std::size_t k = 0; k < at_once.size(); ++k) EXPECT_EQ(one_by_one.of(k), at_once.of(k)) << "scan " << k;
}

}  // namespace
}  // namespace omnifleet::scan
