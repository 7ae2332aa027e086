// Rendered rooms whose walls are higher than the camera: in the image they merge with the objects in front of
// them.

#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "local_mapper/local_mapper.h"
#include "synthetic/renderer.h"

namespace omnifleet::local_mapper {
namespace {

class Walls : public ::testing::Test {
 protected:
  /// @param more keys of the room, obstacles among them @param floor keys of the floor
  static synthetic::Arena room(const std::string& more, const std::string& floor = "texture: 0.04") {
    return synthetic::Arena::read(options::Section::parse("floor: {size_m: [4.4, 3.6], " + floor + "}" + R"(
frames: {rate_hz: 5, duration_s: 1}
image: {noise: 1.5, shot_noise: 0.06}
robots: {r1: {initial_pose: [0, 0, 0]}}
rigs:
  fisheye: {camera_model: fisheye, projection: equidistant, image_width: 640, image_height: 480, focal_px: 148.65932,
            principal_point_px: [319.5, 239.5], fov_deg: 185, position_m: [0, 0, 0.5], self_mask_radius_px: 99}
)" + more,
                                                          "room.yaml"));
  }
  static cv::Mat pictureOf(const synthetic::Arena& arena, const Pose2& map_from_base = {}) {
    synthetic::Renderer renderer(arena, arena.cameras.front().id, 3);
    cv::Mat image;
    renderer.render(0, {map_from_base}, image);
    return image;
  }
  /// Copies the floor's appearance up to the horizon and above it.
  static void extendFloorToHorizon(const synthetic::Arena& arena, cv::Mat& image) {
    const lens::Camera camera(arena.cameras.front().model);
    for (int v = 0; v < image.rows; ++v) {
      for (int u = 0; u < image.cols; ++u) {
        const auto ray = camera.rayFromPixel({u, v});
        if (!ray || ray->z() <= -0.02) continue;
        const auto below = camera.pixelFromPoint({10 * ray->x(), 10 * ray->y(), 0.0});
        image.at<cv::Vec3b>(v, u) = image.at<cv::Vec3b>(cvRound(below->y()), cvRound(below->x()));
      }
    }
  }
  /// Distance to the walls of the room in the direction of a ray.
  static double wallAlong(std::size_t ray, const Pose2& at) {
    const double x_m = at.x_m, y_m = at.y_m;
    const double bearing = static_cast<double>(ray) * M_PI / 180.0 + at.theta_rad, c = std::cos(bearing),
                 s = std::sin(bearing);
    const double along_x = c > 0 ? (2.2 - x_m) / c : (2.2 + x_m) / -c,
                 along_y = s > 0 ? (1.8 - y_m) / s : (1.8 + y_m) / -s;
    return std::min(along_x, along_y);
  }
  /// Radial extent of this many pixels on the floor.
  static double pixelsAt(double range_m, double pixels) {
    return pixels * (0.25 + range_m * range_m) / 0.5 / 148.7;
  }
  /// Rays that see floor behind the walls, and rays with the label of a wall that end at one or short of it,
  /// by more than two cells of the map and two pixels.
  struct Ends {
    int behind = 0, at_walls = 0, short_of = 0;
  };
  static Ends endsOf(const LocalMap& map, const Pose2& at) {
    Ends ends;
    for (std::size_t ray = 0; ray < map.scan.range_m.size(); ++ray) {
      const double wall_m = wallAlong(ray, at), off_m = map.scan.range_m[ray] - wall_m;
      ends.behind += off_m > 0.1 + pixelsAt(wall_m, 2.0) ? 1 : 0;
      if (map.scan.label[ray] != RayLabel::kObstacle) continue;
      ends.at_walls += std::abs(off_m) <= 0.1 + pixelsAt(wall_m, 2.0) ? 1 : 0;
      ends.short_of += off_m < -0.1 - pixelsAt(wall_m, 2.0) ? 1 : 0;
    }
    return ends;
  }
  static LocalMap mapOf(const synthetic::Arena& arena, const cv::Mat& image, const Options& options = {}) {
    LocalMapper mapper(lens::Camera(arena.cameras.front().model), options);
    Frame frame;
    frame.acquired_ns = arena.frameTimeNs(0);
    frame.image = image;
    return mapper.process(frame, {});
  }
  /// The first of the room's `objects` visible objects is found, and no other than these.
  static void expectFirstIsSeen(const std::string& more, std::size_t objects) {
    const synthetic::Arena arena = room(more);
    const LocalMap map = mapOf(arena, pictureOf(arena));
    EXPECT_EQ(map.objects.size(), objects);
    EXPECT_EQ(objectsAt(arena.solids[0], map), 1U);
  }
  /// Each object of kObjects is found separately, and nothing else.
  static void expectObjectsAreSeen(const synthetic::Arena& arena, const LocalMap& map, const char* walls) {
    EXPECT_EQ(map.objects.size(), 5U) << walls;
    for (const synthetic::Solid& solid : arena.solids) {
      if (solid.wall) continue;
      EXPECT_EQ(objectsAt(solid, map), 1U) << walls << " " << solid.map_from_solid.x_m;
    }
  }
  /// Number of objects whose contact lies within 6 cm (two pixels there) of an obstacle's edge.
  static std::size_t objectsAt(const synthetic::Solid& solid, const LocalMap& map) {
    return static_cast<std::size_t>(
        std::count_if(map.objects.begin(), map.objects.end(), [&](const ObjectObservation& object) {
          return std::abs(solid.distance(object.contact_m, solid.map_from_solid)) < 0.06;
        }));
  }
};

// Objects beside one another, in a corner, and of a robot's size and colour. All of them reach the wall in
// the image.
const char* const kObjects = R"(
obstacles:
  - {kind: box, pose: [1.5, 0.2, 0.3], size_m: [0.30, 0.22], height_m: 0.20, rgb: [190, 52, 40]}
  - {kind: cylinder, pose: [0.2, 1.2, 0], radius_m: 0.14, height_m: 0.24, rgb: [40, 78, 170]}
  - {kind: box, pose: [-1.5, 1.1, 0.8], size_m: [0.24, 0.24], height_m: 0.22, rgb: [44, 140, 70]}
  - {kind: cylinder, pose: [-0.9, -0.8, 0], radius_m: 0.15, height_m: 0.30, rgb: [38, 38, 42]}
  - {kind: box, pose: [0.8, -1.25, 0.1], size_m: [0.20, 0.20], height_m: 0.16, rgb: [150, 60, 150]}
)";

const char* const kUnevenLight =
    "light: {level: 0.95, gradient_per_m: [0.02, -0.03], spot: 0.15, spot_m: [-1.0, 0.8], spot_size_m: 1.2, "
    "contact_shadow: 0.25}\n";

TEST_F(Walls, FindsObjectsInFrontOfHighWalls) {
  for (const char* walls :
       {"walls: {height_m: 2.4, rgb: [112, 104, 88]}", "walls: {height_m: 0.8, texture: 0.3}",
        "walls: {height_m: 1.0, rgb: [108, 193, 196]}"}) {
    const synthetic::Arena arena = room(std::string(kObjects) + walls);
    const cv::Mat image = pictureOf(arena);
    const LocalMap map = mapOf(arena, image);
    expectObjectsAreSeen(arena, map, walls);
    for (const ObjectObservation& object : map.objects) EXPECT_GT(object.solidity, 0.94) << walls;
    Options without;
    without.walls.enabled = false;
    EXPECT_LT(mapOf(arena, image, without).objects.size(), 5U) << walls;
  }
}

// Walls with visible tops: objects in front of them are found separately, grey ones as well, and nothing
// else.
TEST_F(Walls, FindsObjectsInFrontOfLowWalls) {
  for (const char* walls :
       {"walls: {height_m: 0.2, rgb: [130, 160, 70]}", "walls: {height_m: 0.3, rgb: [120, 90, 60]}",
        "walls: {height_m: 0.25, rgb: [90, 130, 170], texture: 0.1}"}) {
    const synthetic::Arena arena = room(std::string(kObjects) + walls);
    const cv::Mat image = pictureOf(arena);
    const LocalMap map = mapOf(arena, image);
    expectObjectsAreSeen(arena, map, walls);
    Options without;
    without.ground.low_walls = false;
    EXPECT_LT(mapOf(arena, image, without).objects.size(), 5U) << walls;
    const Ends ends = endsOf(map, {});
    EXPECT_EQ(ends.behind, 0) << walls;
    EXPECT_GT(ends.at_walls, 180) << walls;
    EXPECT_LT(ends.short_of, 12) << walls;  // beside objects of nearly their colour
  }
}

// Distant walls are as thin as nearby markings; removed as markings they would leave only pieces. Of sides
// that are lit like the floor only pieces are visible.
TEST_F(Walls, DetectsWallsAsThinAsMarkings) {
  const std::string sun = "light: {ambient: 0.5, sun: [-0.6, 0.5, 0.7]}\n";
  for (const std::string walls : {"walls: {height_m: 0.08, thickness_m: 0.04, rgb: [70, 60, 50]}",
                                  "walls: {height_m: 0.08, thickness_m: 0.04, rgb: [190, 90, 60]}",
                                  "walls: {height_m: 0.1, thickness_m: 0.05, rgb: [200, 180, 140]}"}) {
    const synthetic::Arena arena = room(sun + kObjects + walls);
    const LocalMap map = mapOf(arena, pictureOf(arena));
    expectObjectsAreSeen(arena, map, walls.c_str());
  }
  const synthetic::Arena bare = room(
      "light: {ambient: 0.6, sun: [-0.8, 0.3, 1.0]}\n"
      "walls: {height_m: 0.1, thickness_m: 0.04, rgb: [230, 230, 225]}");
  EXPECT_TRUE(mapOf(bare, pictureOf(bare, {0.9, -0.5, 2.0})).objects.empty());
}

// Three pixels of floor between an object's top and the wall belong to neither.
TEST_F(Walls, ExcludesFloorBetweenObjectAndWall) {
  const synthetic::Arena arena = room(
      "obstacles: [{kind: box, pose: [1.14, 0, 0], size_m: [0.3, 0.4], height_m: 0.18, rgb: [40, 78, 170]}]\n"
      "walls: {height_m: 0.25, rgb: [160, 70, 50]}");
  const LocalMap map = mapOf(arena, pictureOf(arena));
  ASSERT_EQ(map.objects.size(), 1U);
  double far_m = 0.0;
  for (const Eigen::Vector2d& corner : map.objects[0].hull_m) far_m = std::max(far_m, corner.x());
  const double top_m = 1.29 * 0.5 / (0.5 - 0.18);  // on the floor
  EXPECT_NEAR(far_m, top_m, pixelsAt(top_m, 1.0));
}

// A connected region over less than half of the turn is an object, however large.
TEST_F(Walls, KeepsLargeNearbyObjectAsObject) {
  const synthetic::Arena arena = room(
      "obstacles: [{kind: box, pose: [0.75, 0, 0], size_m: [0.4, 1.6], height_m: 0.2, rgb: [160, 70, 50]}]");
  const LocalMap map = mapOf(arena, pictureOf(arena));
  EXPECT_EQ(map.objects.size(), 1U);
  EXPECT_EQ(std::count(map.scan.label.begin(), map.scan.label.end(), RayLabel::kObstacle), 0);
}

// The result does not depend on what the previous frame showed.
TEST_F(Walls, KeepsNothingOfThePreviousFrame) {
  for (const char* walls :
       {"walls: {height_m: 0.25, rgb: [120, 90, 60]}", "walls: {height_m: 2.4, rgb: [112, 104, 88]}"}) {
    const synthetic::Arena arena = room(std::string(kObjects) + walls);
    LocalMapper mapper(lens::Camera(arena.cameras.front().model), Options{}),
        fresh(lens::Camera(arena.cameras.front().model), Options{});
    Frame frame;
    const auto areasOf = [&](LocalMapper& of, const cv::Mat& image) {
      frame.image = image;
      frame.acquired_ns += 200'000'000;
      of.process(frame, {});
      std::vector<int> areas;
      for (const ground::Blob& blob : of.labelledBlobs()) areas.push_back(blob.area_px);
      return areas;
    };
    areasOf(mapper, pictureOf(arena, {-0.5, 0.4, 1.0}));
    const cv::Mat image = pictureOf(arena);
    EXPECT_EQ(areasOf(mapper, image), areasOf(fresh, image)) << walls;
  }
}

TEST_F(Walls, EndsScanAtHighWalls) {
  const synthetic::Arena arena = room(std::string(kObjects) + "walls: {height_m: 1.0, rgb: [112, 104, 88]}");
  const LocalMap map = mapOf(arena, pictureOf(arena));
  for (const std::size_t bearing_deg : {55U, 105U, 180U, 250U, 350U}) {  // no object there
    const double bearing = static_cast<double>(bearing_deg) * M_PI / 180.0;
    const double wall_m = std::min(2.2 / std::max(1e-9, std::abs(std::cos(bearing))),
                                   1.8 / std::max(1e-9, std::abs(std::sin(bearing))));
    EXPECT_EQ(map.scan.label[bearing_deg], RayLabel::kObstacle) << bearing_deg;
    EXPECT_EQ(map.scan.object[bearing_deg], 0) << bearing_deg;
    // A pixel and a half radially: 5 to 10 cm.
    EXPECT_NEAR(map.scan.range_m[bearing_deg], wall_m, 1.5 * (0.25 + wall_m * wall_m) / 0.5 / 148.7)
        << bearing_deg;
  }
  EXPECT_GT(map.scan.object[8], 0) << "the red box";
}

TEST_F(Walls, FindsFreeStandingObject) {
  const synthetic::Arena arena = room(std::string(kObjects) + R"(
  - {kind: box, pose: [0.55, 0.45, 0.3], size_m: [0.16, 0.16], height_m: 0.08, rgb: [190, 52, 40]}
walls: {height_m: 1.0, rgb: [112, 104, 88]}
)");
  const LocalMap map = mapOf(arena, pictureOf(arena));
  EXPECT_EQ(map.objects.size(), 6U);
  EXPECT_EQ(objectsAt(arena.solids[5], map), 1U);
}

TEST_F(Walls, AcceptsWallsOfDifferentColours) {
  const synthetic::Arena arena = room(std::string(kObjects) + R"(
  - {kind: box, pose: [2.25, 0, 0], size_m: [0.1, 3.8], height_m: 1.2, rgb: [60, 90, 140]}
  - {kind: box, pose: [-2.25, 0, 0], size_m: [0.1, 3.8], height_m: 1.2, rgb: [205, 200, 120]}
  - {kind: box, pose: [0, 1.85, 0], size_m: [4.4, 0.1], height_m: 1.2, rgb: [112, 104, 88]}
  - {kind: box, pose: [0, -1.85, 0], size_m: [4.4, 0.1], height_m: 1.2, rgb: [90, 150, 100]}
)");
  const LocalMap map = mapOf(arena, pictureOf(arena));
  EXPECT_EQ(map.objects.size(), 5U);
  for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(objectsAt(arena.solids[i], map), 1U) << i;
}

/// Walls beyond the range of the scan, where objects are still visible.
TEST_F(Walls, FindsObjectsInFrontOfFarWalls) {
  expectFirstIsSeen(R"(
obstacles:
  - {kind: box, pose: [2.55, 0.2, 0.3], size_m: [0.30, 0.30], height_m: 0.30, rgb: [190, 52, 40]}
  - {kind: cylinder, pose: [0.2, 1.2, 0], radius_m: 0.14, height_m: 0.24, rgb: [40, 78, 170]}
  - {kind: box, pose: [3.15, 0, 0], size_m: [0.1, 3.8], height_m: 1.2, rgb: [112, 104, 88]}
  - {kind: box, pose: [-2.25, 0, 0], size_m: [0.1, 3.8], height_m: 1.2, rgb: [112, 104, 88]}
  - {kind: box, pose: [0.5, 1.85, 0], size_m: [5.4, 0.1], height_m: 1.2, rgb: [112, 104, 88]}
  - {kind: box, pose: [0.5, -1.85, 0], size_m: [5.4, 0.1], height_m: 1.2, rgb: [112, 104, 88]}
)",
                    2U);
}

/// The object hides the end of the wall, so that wall is visible only on one side of it.
TEST_F(Walls, FindsObjectAtTheEndOfAWall) {
  expectFirstIsSeen(R"(
obstacles:
  - {kind: box, pose: [1.45, 1.3, 0.73], size_m: [0.30, 0.30], height_m: 0.25, rgb: [190, 52, 40]}
  - {kind: box, pose: [2.25, -0.2, 0], size_m: [0.1, 4.4], height_m: 1.2, rgb: [112, 104, 88]}
)",
                    1U);
}

/// Doors and skirting boards touch the floor where the wall does.
TEST_F(Walls, IgnoresPartsOfWalls) {
  const synthetic::Arena arena = room(R"(
obstacles:
  - {kind: box, pose: [2.19, 0.3, 0], size_m: [0.02, 0.7], height_m: 0.42, rgb: [120, 70, 30]}
  - {kind: box, pose: [-0.5, 1.79, 0], size_m: [0.5, 0.02], height_m: 0.30, rgb: [200, 200, 210]}
  - {kind: box, pose: [0.2, -1.65, 0], size_m: [0.4, 0.3], height_m: 0.20, rgb: [150, 60, 150]}
walls: {height_m: 1.0, rgb: [108, 193, 196]}
)");
  const LocalMap map = mapOf(arena, pictureOf(arena));
  ASSERT_EQ(map.objects.size(), 1U);
  EXPECT_EQ(objectsAt(arena.solids[2], map), 1U) << "a box against the wall is an object";
}

/// Something higher than the camera that is not a wall of a room remains an object.
TEST_F(Walls, KeepsPillarAsObject) {
  expectFirstIsSeen(R"(
obstacles: [{kind: cylinder, pose: [0.9, 0.3, 0], radius_m: 0.15, height_m: 0.9, rgb: [40, 78, 170]}]
)",
                    1U);
}

// By the region growing of the floor alone no part of such walls is an object: they are taken for floor or
// its shadow.
constexpr const char* kNearFloor[] = {"walls: {height_m: 2.5, rgb: [205, 190, 160], texture: 0.15}",
                                      "walls: {height_m: 2.5, rgb: [235, 235, 230], texture: 0.1}",
                                      "walls: {height_m: 2.5, rgb: [150, 150, 150], texture: 0.1}"};

TEST_F(Walls, EndsScanAtWallsOfNearlyTheFloorColour) {
  for (const char* walls : kNearFloor) {
    const synthetic::Arena arena = room(std::string(kObjects) + kUnevenLight + walls);
    const LocalMap map = mapOf(arena, pictureOf(arena));
    const Ends ends = endsOf(map, {});
    EXPECT_LE(ends.behind, 10) << walls;  // beside objects, where one of their edges is nearer
    EXPECT_GE(ends.at_walls, 200) << walls;
    EXPECT_LE(ends.short_of, 30) << walls;
    std::size_t seen = 0;
    for (const synthetic::Solid& solid : arena.solids) seen += solid.wall ? 0 : objectsAt(solid, map);
    EXPECT_GE(seen, 4U) << walls;  // one may be undecided, if it and a patch of wall form one region
    EXPECT_EQ(map.objects.size(), seen) << walls;
  }
}

/// Such walls are no regions. Localization and map need the edge itself, not the end of the grown floor.
TEST_F(Walls, MeasuresTheFootOfWallsOfNearlyTheFloorColour) {
  for (const char* walls : kNearFloor) {
    const synthetic::Arena arena = room(std::string(kUnevenLight) + walls);
    const LocalMap map = mapOf(arena, pictureOf(arena, {-0.9, -0.6, 0}));
    int near = 0, measured = 0, right = 0;
    for (std::size_t beam = 0; beam < map.boundary.inverse_m.size(); ++beam) {
      const double wall_m = wallAlong(beam / 2, {-0.9, -0.6, 0});
      if (beam % 2 != 0 || wall_m > 1.8) continue;
      ++near;
      if (!(map.boundary.inverse_m[beam] > 0.0f)) continue;
      ++measured;
      right +=
          std::abs(1.0 / static_cast<double>(map.boundary.inverse_m[beam]) - wall_m) < pixelsAt(wall_m, 2.0)
              ? 1
              : 0;
    }
    EXPECT_GE(measured, 0.8 * near) << walls;
    EXPECT_GE(right, 0.8 * measured) << walls;  // shadows at the foot of the wall move some edges
  }
}

/// The walls lie in the ring from which the floor's colours are learned.
TEST_F(Walls, DoesNotLearnNearbyWallsAsFloor) {
  for (const char* walls : kNearFloor) {
    const synthetic::Arena arena = room(std::string(kUnevenLight) + walls);
    const Ends ends = endsOf(mapOf(arena, pictureOf(arena, {-1.7, -1.3, 0})), {-1.7, -1.3, 0});
    EXPECT_LE(ends.behind, 10) << walls;
    EXPECT_GE(ends.at_walls, 200) << walls;
  }
}

/// What is above the horizon does not continue below it, so it is no wall.
TEST_F(Walls, FindsNoWallsWhereThereAreNone) {
  const synthetic::Arena arena = room(std::string(kObjects) + kUnevenLight);
  const LocalMap map = mapOf(arena, pictureOf(arena));
  EXPECT_EQ(map.objects.size(), 5U);
  for (const RayLabel label : map.scan.label) EXPECT_NE(label, RayLabel::kObstacle);
}

constexpr const char* kDark = "walls: {height_m: 1.0, rgb: [112, 104, 88]}";
constexpr const char* kWhite = "walls: {height_m: 2.4, rgb: [235, 235, 230], texture: 0.05}";

/// White walls on grey floors: only the intensity edge at its foot distinguishes a side that is lit like the
/// floor, and the region growing of the floor leaks onto it. An earlier frame with a side in other light
/// showed that there is a room.
TEST_F(Walls, EndsScanAtWallsLitLikeTheFloor) {
  for (const char* floor :
       {"rgb: [130, 130, 130], texture: 0.03, clouds: 0.04", "rgb: [150, 150, 150], texture: 0.03",
        "rgb: [165, 165, 165], texture: 0.04", "rgb: [180, 180, 180], texture: 0.02",
        "rgb: [150, 150, 150], texture: 0.03, grid_m: 0.5, tile_variation: 0.05"}) {
    const synthetic::Arena arena = room(std::string(kObjects) + kUnevenLight + kWhite, floor);
    LocalMapper mapper(lens::Camera(arena.cameras.front().model), {});
    Frame frame;
    frame.image = pictureOf(room(std::string(kObjects) + kDark, floor));
    mapper.process(frame, {});
    for (const Pose2& at : {Pose2{}, Pose2{-0.3, -0.2, 1.0}, Pose2{0.7, -0.4, 2.5}}) {
      frame.image = pictureOf(arena, at);
      frame.acquired_ns += 200'000'000;
      const Ends ends = endsOf(mapper.process(frame, {}), at);
      EXPECT_LE(ends.behind, 20) << floor << " at " << at.x_m;
      EXPECT_GE(ends.at_walls, 180) << floor << " at " << at.x_m;
      EXPECT_LE(ends.short_of, 12) << floor << " at " << at.x_m;
    }
  }
}

/// In corners the line of one wall continues where the other wall is nearer.
TEST_F(Walls, JoinsWallsLitLikeTheFloorInCorners) {
  const char* floor = "rgb: [150, 150, 150], texture: 0.03";
  const synthetic::Arena arena = room(std::string(kUnevenLight) + kWhite, floor);
  LocalMapper mapper(lens::Camera(arena.cameras.front().model), {});
  Frame frame;
  frame.image = pictureOf(room(kDark, floor));
  mapper.process(frame, {});
  for (const Pose2& at :
       {Pose2{0.9, 0.6, 0.0}, Pose2{-1.0, 0.5, 0.0}, Pose2{1.1, -0.7, 0.0}, Pose2{-0.9, -0.9, 0.0}}) {
    frame.image = pictureOf(arena, at);
    frame.acquired_ns += 200'000'000;
    const Ends ends = endsOf(mapper.process(frame, {}), at);
    EXPECT_LE(ends.behind, 8) << at.x_m << " " << at.y_m;
    EXPECT_GE(ends.at_walls + ends.short_of, 226) << at.x_m << " " << at.y_m;
  }
}

/// What has the floor's colour above the horizon is no wall if nothing ends the floor before it.
TEST_F(Walls, FindsNoWallsOnFloorUpToTheHorizon) {
  for (const char* floor : {"rgb: [150, 150, 150], texture: 0.03, grid_m: 0.5, tile_variation: 0.05",
                            "rgb: [40, 40, 44], texture: 0.03"}) {
    const synthetic::Arena arena = room(std::string(kObjects) + kUnevenLight, floor);
    cv::Mat image = pictureOf(arena);
    extendFloorToHorizon(arena, image);
    const LocalMap map = mapOf(arena, image);
    EXPECT_EQ(map.objects.size(), 5U) << floor;
    for (const RayLabel label : map.scan.label) EXPECT_NE(label, RayLabel::kObstacle) << floor;
  }
}

TEST_F(Walls, FindsObjectsInFrontOfWallsInGreyImages) {
  const synthetic::Arena arena = room(std::string(kObjects) + "walls: {height_m: 1.0, rgb: [120, 120, 120]}");
  cv::Mat grey;
  cv::cvtColor(pictureOf(arena), grey, cv::COLOR_BGR2GRAY);
  const LocalMap map = mapOf(arena, grey);
  EXPECT_GE(map.objects.size(), 3U);
  for (const ObjectObservation& object : map.objects) {
    EXPECT_TRUE(std::any_of(arena.solids.begin(), arena.solids.end(), [&](const synthetic::Solid& solid) {
      return !solid.wall && std::abs(solid.distance(object.contact_m, solid.map_from_solid)) < 0.06;
    })) << object.contact_m.transpose();
  }
}

}  // namespace
}  // namespace omnifleet::local_mapper
