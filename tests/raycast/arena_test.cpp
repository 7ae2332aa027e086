// Arena recordings against closed forms: rays, markers, feet of walls, paths without collisions, files.

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "dataset/dataset.h"
#include "dataset/ground_truth.h"
#include "tests/raycast/arena_recording.h"
#include "tests/raycast/arena_renderer.h"
#include "tests/raycast/room_path.h"

namespace omnifleet::raycast {
namespace {

namespace fs = std::filesystem;

ArenaOptions small(unsigned seed) {
  ArenaOptions options;
  options.seed = seed;
  options.layout = 1 + static_cast<int>(seed % 2);
  options.frames = 2;
  options.noise = 0.0;
  return options;
}

/// A recording in a folder that is removed with the object.
class Folder {
 public:
  explicit Folder(const ArenaOptions& options)
      : path_(fs::path(::testing::TempDir()) / ("omnifleet_arena_" + std::to_string(::getpid()))) {
    fs::remove_all(path_);
    recordArena(path_.string(), options);
  }
  ~Folder() { fs::remove_all(path_); }
  std::string path() const { return path_.string(); }
  std::string bytes(const std::string& file) const {
    std::ifstream in(path_ / file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  }

 private:
  fs::path path_;
};

TEST(ArenaCamera, RaysAgreeWithLensOfProduct) {
  const ArenaStory story = arenaStory(small(1));
  for (const lens::CameraModel& model : {story.front, story.ceiling[0], story.ceiling[1]}) {
    const lens::Camera reference(model);
    const ArenaCamera camera(model);
    double worst_px = 0.0;
    for (int v = 0; v < camera.rows(); v += 13) {
      for (int u = 0; u < camera.columns(); u += 13) {
        for (const auto& [i, j] : {std::pair(0, 3), std::pair(2, 1)}) {
          const Eigen::Vector2f& ray = camera.ray(u, v, i, j);
          const auto pixel = reference.lens().pixelFromRay(Eigen::Vector3d(ray.x(), ray.y(), 1.0));
          ASSERT_TRUE(pixel) << u << ' ' << v;
          const Eigen::Vector2d sample(u + (i + 0.5) / 4 - 0.5, v + (j + 0.5) / 4 - 0.5);
          worst_px = std::max(worst_px, (*pixel - sample).norm());
        }
      }
    }
    EXPECT_LT(worst_px, 1e-3);  // rays are stored as float
  }
}

TEST(ArenaCamera, FrontLooksTwelveDegreesDown) {
  const lens::CameraModel model = arenaStory(small(1)).front;
  const lens::Camera camera(model);
  const auto ray = camera.rayFromPixel(model.principal_point_px);
  ASSERT_TRUE(ray);
  EXPECT_NEAR(std::atan2(-ray->z(), ray->x()) * 180.0 / M_PI, 12.0, 1e-9);
  EXPECT_NEAR(ray->y(), 0.0, 1e-9);
}

/// Mean projection of a rectangle at the height of the markers, given in base_link.
Eigen::Vector2d projectedCentre(const lens::CameraModel& model, const Pose2& map_from_base,
                                const Eigen::Vector2d& middle, const Eigen::Vector2d& size) {
  constexpr int kSteps = 40;
  const lens::Camera camera(model);
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (int a = 0; a < kSteps; ++a) {
    for (int b = 0; b < kSteps; ++b) {
      const Eigen::Vector2d share((a + 0.5) / kSteps - 0.5, (b + 0.5) / kSteps - 0.5);
      const Eigen::Vector2d at = map_from_base * (middle + share.cwiseProduct(size));
      sum += camera.pixelFromPoint({at.x(), at.y(), kBodyHeight_m}).value();
    }
  }
  return sum / (kSteps * kSteps);
}

TEST(ArenaRenderer, MarkersAppearWhereCalibrationPredicts) {
  const ArenaOptions options = small(2);
  ArenaStory story = arenaStory(options);
  story.layout.house.furniture.clear();
  story.layout.parked = {{-0.3, 0.4, 0.7}, {0.35, -0.5, -2.0}};
  story.layout.cards.clear();
  const ArenaScene scene(story.layout, options);
  for (const lens::CameraModel& model : story.ceiling) {
    const cv::Mat3f image = ArenaRenderer(scene, model).fixed({});
    for (std::size_t k = 0; k < story.layout.parked.size(); ++k) {
      const Pose2& pose = story.layout.parked[k];
      const dataset::MarkerSet& set = story.layout.markers;
      const Eigen::Vector2d expected = projectedCentre(model, pose, set.head_offset_m, set.head_size_m);
      const auto at = [&](const Eigen::Vector2d& in_base) {
        const Eigen::Vector2d place = pose * in_base;
        return lens::Camera(model).pixelFromPoint({place.x(), place.y(), kBodyHeight_m}).value();
      };
      const auto colour = [&](const Eigen::Vector2d& pixel) {
        return image(static_cast<int>(std::lround(pixel.y())), static_cast<int>(std::lround(pixel.x())));
      };
      // Share of the head in each pixel around it, from the colours of the head and of the cover beside it.
      const cv::Vec3f head = colour(expected), cover = colour(at({0.063, 0.0})), towards = head - cover;
      Eigen::Vector2d sum = Eigen::Vector2d::Zero();
      double weight = 0.0;
      for (int v = -8; v <= 8; ++v) {
        for (int u = -8; u <= 8; ++u) {
          const int x = static_cast<int>(std::lround(expected.x())) + u,
                    y = static_cast<int>(std::lround(expected.y())) + v;
          const Eigen::Vector2d place =
              pose.inverse() *
              lens::Camera(model).planeFromPixel(Eigen::Vector2d(x, y), kBodyHeight_m).value();
          if ((place - set.head_offset_m).cwiseAbs().maxCoeff() > 0.5 * set.head_size_m.x() + 0.007) continue;
          const double share = (image(y, x) - cover).dot(towards) / towards.dot(towards);
          sum += share * Eigen::Vector2d(x, y);
          weight += share;
        }
      }
      EXPECT_LT((sum / weight - expected).norm(), 0.05) << k;  // 16 samples per edge pixel
    }
  }
}

/// A layout without blocks, with r1 at a pose.
ArenaStory emptyArena(const ArenaOptions& options) {
  ArenaStory story = arenaStory(options);
  story.layout.house.furniture.clear();
  story.layout.cards.clear();
  story.layout.parked = {{-1.0, 0.6, 0.0}, {-1.0, -0.6, 0.0}};
  return story;
}

/// What the front camera shows at a sample of a pixel.
class FrontView {
 public:
  FrontView(const ArenaStory& story, const ArenaScene& scene, const Pose2& pose,
            const std::vector<ArenaBox>& moving = {}, int own = -1)
      : moving_(moving), camera_(story.front), view_(scene, camera_, pose, moving_, own) {}

  Surface3 at(int u, int v, int i, int j) const {
    const int tile = v / ArenaCamera::kTile_px * camera_.tileColumns() + u / ArenaCamera::kTile_px;
    return view_.surfaceAlong(static_cast<std::size_t>(tile), view_.along(camera_.ray(u, v, i, j)));
  }
  const ArenaCamera& camera() const { return camera_; }

 private:
  std::vector<ArenaBox> moving_;
  ArenaCamera camera_;
  ArenaView view_;
};

TEST(ArenaView, FootOfWallAppearsInPredictedRow) {
  const ArenaOptions options = small(3);
  const ArenaStory story = emptyArena(options);
  const ArenaScene scene(story.layout, options);
  const double wall_m = story.layout.house.rooms.front().high.x();
  for (const double distance_m : {0.15, 0.3, 0.6, 1.0}) {  // from the camera
    const Pose2 pose{wall_m - distance_m - story.front.position_m.x(), 0.0, 0.0};
    const FrontView view(story, scene, pose);
    const Eigen::Vector2d foot =
        lens::Camera(story.front).pixelFromPoint({wall_m - pose.x_m, 0.0, 0.0}).value();
    const int column = static_cast<int>(std::lround(foot.x()));
    double last_wall = -1.0, first_floor = 1e9;
    for (int v = 0; v < view.camera().rows(); ++v) {
      for (int j = 0; j < ArenaCamera::kSamples; ++j) {
        const double row = v + (j + 0.5) / ArenaCamera::kSamples - 0.5;
        const Surface3 surface = view.at(column, v, 2, j);
        if (surface.face == Surface3::kBack) last_wall = row;
        if (surface.face == Surface3::kFloor) first_floor = std::min(first_floor, row);
      }
    }
    // The wall is perpendicular to the axis, so its foot hardly changes its row beside the column.
    EXPECT_NEAR(0.5 * (last_wall + first_floor), foot.y(), 0.5 / ArenaCamera::kSamples + 0.01) << distance_m;
    EXPECT_NEAR(first_floor - last_wall, 1.0 / ArenaCamera::kSamples, 1e-9);
  }
}

TEST(ArenaView, OtherRobotAppearsAndOwnBodyDoesNot) {
  const ArenaOptions options = small(3);
  const ArenaStory story = emptyArena(options);
  const ArenaScene scene(story.layout, options);
  const Pose2 own{0.0, 0.0, 0.0}, other{0.6, 0.0, M_PI};
  const std::vector<ArenaBox> robots{scene.robotAt(0, own), scene.robotAt(1, other)};
  const FrontView view(story, scene, own, robots, 0);
  // The near face of the other robot, which is turned around.
  const lens::Camera camera(story.front);
  const double face_m = other.x_m - kBody.high.x();
  // The camera looks down, so the sides of the face converge towards the floor.
  const auto low = camera.pixelFromPoint({face_m, kBody.high.y(), 0.0}).value(),
             left_top = camera.pixelFromPoint({face_m, kBody.high.y(), kBodyHeight_m}).value(),
             right_top = camera.pixelFromPoint({face_m, kBody.low.y(), kBodyHeight_m}).value();
  int left = view.camera().columns(), right = -1, top = view.camera().rows(), bottom = -1;
  for (int v = 0; v < view.camera().rows(); ++v) {
    for (int u = 0; u < view.camera().columns(); ++u) {
      if (view.at(u, v, 2, 2).box < static_cast<int>(scene.boxes().size())) continue;
      left = std::min(left, u);
      right = std::max(right, u);
      top = std::min(top, v);
      bottom = std::max(bottom, v);
    }
  }
  // Sample (2, 2) lies 1/8 px beside the middle; whole pixels round up on one side, down on the other.
  EXPECT_NEAR(left, left_top.x() + 0.375, 0.6);
  EXPECT_NEAR(right, right_top.x() - 0.625, 0.6);
  EXPECT_NEAR(top, left_top.y() + 0.375, 0.6);
  EXPECT_NEAR(bottom, low.y() - 0.625, 0.6);
}

TEST(ArenaRenderer, FixedImageEqualsCompleteRendering) {
  const ArenaOptions options = small(5);
  const ArenaStory story = arenaStory(options);
  const ArenaScene scene(story.layout, options);
  std::vector<ArenaBox> moving;
  for (int r = 0; r < kMapping; ++r) moving.push_back(scene.robotAt(r, story.drive.at(r, 1.0)));
  ArenaRenderer renderer(scene, story.ceiling[0]);
  const cv::Mat3f fast = renderer.fixed(moving), complete = renderer.fromRobot({}, moving, -1);
  EXPECT_LT(cv::norm(fast, complete, cv::NORM_INF), 0.02);  // faint shadows end at the border of the tiles
}

TEST(ArenaDrive, KeepsClearAndShowsFaces) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    ArenaOptions options = small(seed);
    options.frames = 250;
    const ArenaStory story = arenaStory(options);
    EXPECT_GT(story.drive.seenShare(), 0.8) << seed;
    const House house = withParked(story.layout);
    double nearest = 1.0, longest_step = 0.0;
    std::vector<Pose2> before;
    for (const TimeNs time_ns : story.front_times_ns) {
      const std::vector<Pose2> poses = story.posesAt(time_ns);
      for (int r = 0; r < kMapping; ++r) {
        const Pose2& pose = poses[static_cast<std::size_t>(r)];
        const Polygon body = rectangleAt(pose, kBody.low, kBody.high);
        for (const Eigen::Vector2d& corner : body) EXPECT_TRUE(contains(house.inside, corner));
        for (const auto* list : {&house.walls, &house.furniture})
          for (const Solid& solid : *list)
            nearest = std::min(nearest, gapBetween(truthOf(solid, 0).outline_m, body));
        if (!before.empty())
          longest_step = std::max(
              longest_step, (pose.translation() - before[static_cast<std::size_t>(r)].translation()).norm());
      }
      nearest = std::min(nearest, gapBetween(rectangleAt(poses[0], kBody.low, kBody.high),
                                             rectangleAt(poses[1], kBody.low, kBody.high)));
      before = poses;
    }
    EXPECT_GT(nearest, 0.015) << seed;
    EXPECT_LT(longest_step, 0.045) << seed;
  }
}

TEST(ArenaRecording, WritesTwoMappingAndTwoParkedRobots) {
  const Folder folder(small(1));
  const dataset::Dataset data = dataset::Dataset::open(folder.path());
  ASSERT_EQ(data.robots.size(), 4U);
  for (const dataset::RobotRecording& robot : data.robots) {
    const bool maps = robot.name < "r3";
    EXPECT_FALSE(robot.initial_pose);
    EXPECT_EQ(robot.body.footprint_m.size(), 4U);
    EXPECT_TRUE(robot.wheels.empty());
    EXPECT_EQ(robot.front.has_value(), maps) << robot.name;
    EXPECT_EQ(robot.front ? robot.front->rows.size() : 0U, maps ? 2U : 0U);
    EXPECT_FALSE(robot.fisheye);
  }
  ASSERT_EQ(data.ceiling.size(), 2U);
  ASSERT_TRUE(data.markers);
  EXPECT_EQ(data.markers->kind, dataset::MarkerKind::kCoverTailHead);
  const dataset::GroundTruth truth = dataset::GroundTruth::load(folder.path());
  EXPECT_EQ(truth.trajectories.at("r3").size(), data.ceiling[0].rows.size());
  EXPECT_EQ(truth.trajectories.at("r1").size(), 2U);
}

TEST(ArenaRecording, CeilingImagesLagByStaleTime) {
  ArenaOptions options = small(1);
  const std::string second = "ceiling/c1/data/1000200000000.jpg", first = "ceiling/c1/data/1000000000000.jpg";
  const std::string prompt = Folder(options).bytes(first);
  options.stale_s = 1.0 / options.rate_hz;
  EXPECT_FALSE(prompt.empty());
  EXPECT_EQ(Folder(options).bytes(second), prompt);
}

TEST(ArenaRecording, StopAndWaitKeepsPlacesAndFrontImages) {
  ArenaOptions options = small(1);
  options.frames = 10;
  const ArenaStory moving = arenaStory(options);
  options.wait_s = 0.8;
  options.stale_s = 0.4;
  const ArenaStory standing = arenaStory(options);
  ASSERT_EQ(standing.front_times_ns.size(), 10U);
  EXPECT_EQ(standing.ceiling_times_ns.size(), 50U);
  for (std::size_t k = 0; k < 10; ++k) {
    EXPECT_EQ(standing.front_times_ns[k] - kBegin_ns, static_cast<TimeNs>(k) * 1'000'000'000 + 800'000'000);
    const auto expected = moving.posesAt(moving.front_times_ns[k]);
    for (const TimeNs before_ns : {TimeNs{0}, TimeNs{400'000'000}}) {  // what prompt and stale images show
      const auto poses = standing.posesAt(standing.front_times_ns[k] - before_ns);
      for (std::size_t r = 0; r < poses.size(); ++r) {
        EXPECT_LT((poses[r].translation() - expected[r].translation()).norm(), 1e-6) << k << ' ' << r;
        EXPECT_LT(std::abs(wrapAngle(poses[r].theta_rad - expected[r].theta_rad)), 1e-6) << k << ' ' << r;
      }
    }
  }
}

TEST(ArenaRecording, CeilingTimesFollowOffsetAndRate) {
  ArenaOptions options = small(1);
  options.frames = 10;
  options.ceiling_rate_hz = 8.0;
  options.ceiling_offset_s = 0.05;
  const ArenaStory story = arenaStory(options);
  EXPECT_EQ(story.front_times_ns.size(), 10U);
  ASSERT_EQ(story.ceiling_times_ns.size(), 16U);
  EXPECT_EQ(story.ceiling_times_ns[0] - story.front_times_ns[0], 50'000'000);
  EXPECT_EQ(story.ceiling_times_ns[1] - story.ceiling_times_ns[0], 125'000'000);
}

}  // namespace
}  // namespace omnifleet::raycast
