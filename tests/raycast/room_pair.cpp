#include "tests/raycast/room_pair.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>

#include "dataset/atomic_file.h"
#include "dataset/writer.h"
#include "tests/raycast/value_noise.h"

namespace omnifleet::raycast {
namespace {

/// Share of the second robot's frames near a place that the first robot passes.
double overlapOf(const Drive& drive) {
  constexpr double kNear_m = 0.8;
  int near = 0;
  for (const DriveFrame& own : drive.frames) {
    bool any = false;
    for (const DriveFrame& other : drive.frames)
      any = any || (own.poses[1].translation() - other.poses[0].translation()).norm() < kNear_m;
    near += any ? 1 : 0;
  }
  return static_cast<double>(near) / static_cast<double>(drive.frames.size());
}

/// Shares of overlap that a pair in one room may have.
struct Overlap {
  double least = 0.0, most = 1.0;
  double misses(double share) const { return std::max({0.0, least - share, share - most}); }
};

/// Half of the pairs share most places, three of ten a part, two of ten little.
Overlap wantedOverlap(Random& random) {
  const int choice = random.below(10);
  if (choice < 5) return {0.6, 1.0};
  return choice < 8 ? Overlap{0.3, 0.6} : Overlap{0.1, 0.3};
}

/// Starts apart from each other, and goals that depend on the seed alone.
DrivePlan planOf(const FreeSpace& space, unsigned seed) {
  constexpr double kApart_m = 1.5, kTurned_rad = M_PI / 4.0;
  constexpr int kTries = 1000;
  const auto random = std::make_shared<Random>(seed);
  DrivePlan plan;
  for (int tries = 0; plan.starts.empty(); ++tries) {
    if (tries == kTries) throw std::runtime_error("raycast: no starts 1.5 m apart; choose another seed");
    const Eigen::Vector2d a = space.anywhere(*random), b = space.anywhere(*random);
    const double heading = random->between(-M_PI, M_PI),
                 turn = random->between(kTurned_rad, 2.0 * M_PI - kTurned_rad);
    if ((a - b).norm() > kApart_m)
      plan.starts = {{a.x(), a.y(), heading}, {b.x(), b.y(), wrapAngle(heading + turn)}};
  }
  plan.next_goal = [&space, random](std::size_t, const Pose2&, double, Random&) {
    return space.anywhere(*random);
  };
  return plan;
}

/// Drives until the overlap is as wanted, or nearly.
DrivePlan overlappingPlan(const FurnishedOptions& options, const FreeSpace& space, Random& random) {
  constexpr int kTries = 100;
  const Overlap wanted = wantedOverlap(random);
  unsigned best = 0;
  double least_missed = 2.0;
  for (int tries = 0; tries < kTries && least_missed > 0.0; ++tries) {
    const auto seed = static_cast<unsigned>(random.below(1 << 30));
    Random chance(seed);
    const double missed = wanted.misses(overlapOf(driveAll(options, space, chance, planOf(space, seed))));
    if (missed < least_missed) least_missed = missed, best = seed;
  }
  return planOf(space, best);
}

/// The camera of the second robot exposes differently and lamps age: in every second pair.
void changeLight(Room& room, Random& random) {
  constexpr double kMost = 0.15;
  if (random.below(2) == 0) return;
  room.light *= random.between(1.0 - kMost, 1.0 + kMost);
  for (Lamp& lamp : room.lamps) lamp.power *= random.between(1.0 - kMost, 1.0 + kMost);
}

/// Faults are those of the first robot.
FurnishedOptions withoutFaults(FurnishedOptions options) {
  options.black.reset();
  options.slip.reset();
  options.kidnapped_s.reset();
  options.occluded_share = 0.0;
  return options;
}

/// A room of another size: small, large, or usual but 0.4 m longer or shorter in one direction at least.
FurnishedScene otherScene(const FurnishedScene& first, FurnishedOptions options, Random& random) {
  constexpr double kOther_m = 0.4;
  const int size = random.below(3);
  if (size == 0)
    options.width_min_m = 3.8, options.width_max_m = 4.8, options.depth_min_m = 3.4,
    options.depth_max_m = 4.0;
  if (size == 1)
    options.width_min_m = 6.9, options.width_max_m = 8.0, options.depth_min_m = 5.0,
    options.depth_max_m = 6.5;
  for (;;) {
    options.seed = mixed(options.seed + 1U);
    FurnishedScene other = furnishedScene(options, random);
    const Eigen::Vector2d change = other.house.rooms.front().size() - first.house.rooms.front().size();
    if (change.cwiseAbs().maxCoeff() > kOther_m) return other;
  }
}

/// The same walls, floor and light with other furniture.
FurnishedScene lookalikeScene(const FurnishedScene& first, const FurnishedOptions& options, Random& random) {
  FurnishedScene other = first;
  other.house = refurnished(first.house, options, random);
  other.drive = driveAll(options, FreeSpace(other.house, kClearance_m), random);
  other.room = refurnished(first.room, other.house, options, random);
  other.persons.clear();
  return other;
}

dataset::MapObject roomOf(const House& house) {
  dataset::MapObject outline;
  outline.kind = "room";
  outline.outline_m = house.inside;
  outline.centroid_m = centroid(house.inside);
  return outline;
}

}  // namespace

const char* toString(PairKind kind) {
  if (kind == PairKind::kSame) return "same";
  return kind == PairKind::kLookalike ? "lookalike" : "disjoint";
}

PairKind pairKindOf(const std::string& name) {
  for (const PairKind kind : {PairKind::kSame, PairKind::kLookalike, PairKind::kDisjoint})
    if (name == toString(kind)) return kind;
  throw std::runtime_error("raycast: \"" + name + "\" is no kind of pair");
}

FurnishedPair furnishedPair(PairKind kind, const FurnishedOptions& options) {
  Random random(options.seed * 7919U + 23U), second(options.seed * 104729U + 29U);
  FurnishedOptions own = options;
  own.robots = kind == PairKind::kSame ? 2 : 1;
  FurnishedPair pair;
  pair.kind = kind;
  if (kind == PairKind::kSame) {
    const auto plan = [&](const FreeSpace& space) { return overlappingPlan(own, space, second); };
    pair.scenes[0] = pair.scenes[1] = furnishedScene(own, random, plan);
    pair.map_from_r2 = pair.scenes[0].drive.frames.front().poses[1];
    pair.overlap = overlapOf(pair.scenes[0].drive);
  } else {
    pair.scenes[0] = furnishedScene(own, random);
    pair.scenes[1] = kind == PairKind::kLookalike ? lookalikeScene(pair.scenes[0], withoutFaults(own), second)
                                                  : otherScene(pair.scenes[0], withoutFaults(own), second);
  }
  changeLight(pair.scenes[1].room, second);
  return pair;
}

void recordPair(const std::string& folder, PairKind kind, const FurnishedOptions& options) {
  const FurnishedPair pair = furnishedPair(kind, options);
  Random random(options.seed * 7919U + 31U);
  FurnishedOptions both = options;
  both.robots = 2;
  DriveFrame first;
  for (std::size_t r = 0; r < 2; ++r)
    first.poses.push_back(pair.scenes[r].drive.frames.front().poses[pair.indexInScene(r)]);
  auto robots = robotsOf(both, first, random);
  robots[1].initial_pose.reset();
  dataset::writeDatasetYaml(folder, robots);
  const House& room = pair.scenes[0].house;
  dataset::writeTruthScene(folder, truthOf(room));
  if (options.walls) dataset::writeTruthRoom(folder, room.inside);
  for (std::size_t r = 0; r < 2; ++r)
    writeRobot(folder, robots[r].name, pair.indexInScene(r), pair.scenes[r],
               r == 0 ? options : withoutFaults(options), random);
  if (!pair.map_from_r2) {
    const House& other = pair.scenes[1].house;
    dataset::writeObjects(folder + "/groundtruth/r2/scene.geojson", truthOf(other));
    if (options.walls) dataset::writeObjects(folder + "/groundtruth/r2/room.geojson", {roomOf(other)});
  }
  std::string place = "null";
  if (pair.map_from_r2)
    place = fmt::format("[{}, {}, {}]", pair.map_from_r2->x_m, pair.map_from_r2->y_m,
                        pair.map_from_r2->theta_rad);
  dataset::writeAtomic(
      folder + "/groundtruth/pair.json",
      fmt::format("{{\n  \"kind\": \"{}\",\n  \"map_from_r2\": {},\n  \"overlap\": {:.3f}\n}}\n",
                  toString(kind), place, pair.overlap));
}

}  // namespace omnifleet::raycast
