#include "tests/experiments/exploration/arena.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <cmath>
#include <functional>
#include <vector>

#include "dataset/atomic_file.h"
#include "motion/motion_guard.h"
#include "tests/raycast/random.h"

namespace omnifleet::exploration {
namespace {

using raycast::Random;

constexpr double kWall_m = 0.08, kBlock_m = 0.20, kJoint_m = 0.006;  // blocks of a wall, as in ahmed.yaml
constexpr double kPassage_m = 0.42;
constexpr double kStart_m = 0.16;             // around a robot that explores
constexpr double kApart_m = 0.42;             // between robots
constexpr double kBeside_m[] = {0.02, 0.08};  // a parked robot may stand this near a block
constexpr int kTries = 500;

struct Block {
  Pose2 pose;
  Eigen::Vector2d size_m;
  double height_m;
  bool fixed;
};

Polygon outlineOf(const Block& block) {
  const Eigen::Vector2d half = 0.5 * block.size_m;
  return motion::placed(
      block.pose,
      {{-half.x(), -half.y()}, {half.x(), -half.y()}, {half.x(), half.y()}, {-half.x(), half.y()}});
}

YAML::Node flow(const std::vector<double>& values) {
  YAML::Node node;
  for (const double value : values) node.push_back(fmt::format("{:.4f}", value));
  node.SetStyle(YAML::EmitterStyle::Flow);
  return node;
}

YAML::Node nodeOf(const Pose2& pose) {
  return flow({pose.x_m, pose.y_m, pose.theta_rad});
}

Polygon bodyOf(const YAML::Node& robot) {
  Polygon body;
  for (const auto& vertex : robot["body"]["footprint_m"])
    body.emplace_back(vertex[0].as<double>(), vertex[1].as<double>());
  return body;
}

/// Walls, free-standing blocks and initial poses of a seed.
class Builder {
 public:
  Builder(std::uint32_t seed, const Eigen::Vector2d& half_m, const Polygon& body_m)
      : random_(seed), half_m_(half_m), body_m_(body_m) {}

  bool build() {
    const int walls = 2 + random_.below(2), free_standing = 2 + random_.below(3);
    for (int i = 0; i < walls; ++i) tryTo([this] { return wall(); });
    for (int i = 0; i < free_standing; ++i) tryTo([this] { return block(); });
    for (int i = 0; i < 4; ++i) tryTo([this, i] { return robot(i >= 2); });
    return robots.size() == 4;
  }

  std::vector<Block> blocks;
  std::vector<Pose2> robots;  ///< the first two explore

 private:
  static void tryTo(const std::function<bool()>& attempt) {
    for (int i = 0; i < kTries && !attempt(); ++i) {
    }
  }

  /// Distance of an outline to the outer wall; negative outside.
  double toOuterWall(const Polygon& outline) const {
    double least_m = INFINITY;
    for (const Eigen::Vector2d& vertex : outline)
      least_m = std::min(least_m, (half_m_ - vertex.cwiseAbs()).minCoeff());
    return least_m;
  }

  bool hasRoom(const Polygon& outline) const {
    for (const Block& other : blocks)
      if (motion::distanceBetween(outline, outlineOf(other)) < kPassage_m) return false;
    return true;
  }

  /// A wall of blocks that begins at the outer wall.
  bool wall() {
    const double length_m = random_.between(0.5, 1.1);
    const int side = random_.below(4);
    const double across_m = side < 2 ? half_m_.x() : half_m_.y(),
                 depth_m = side < 2 ? half_m_.y() : half_m_.x();
    if (2.0 * depth_m - length_m < kPassage_m) return false;
    const double along_m = random_.between(-across_m + 0.5, across_m - 0.5);
    const double sign = side % 2 == 0 ? -1.0 : 1.0;
    const auto pieceAt = [&](double from_m, double to_m) {
      const double middle = sign * (depth_m - 0.5 * (from_m + to_m));
      const Pose2 pose = side < 2 ? Pose2{along_m, middle, M_PI_2} : Pose2{middle, along_m, 0.0};
      return Block{pose, {to_m - from_m, kWall_m}, random_.between(0.16, 0.24), true};
    };
    if (!hasRoom(outlineOf(pieceAt(0.0, length_m)))) return false;
    const int n = static_cast<int>(std::ceil(length_m / kBlock_m));
    const double pitch_m = length_m / n;
    for (int i = 0; i < n; ++i)
      blocks.push_back(pieceAt(i * pitch_m + (i == 0 ? kJoint_m : 0.0), (i + 1) * pitch_m - kJoint_m));
    return true;
  }

  bool block() {
    const Block drawn{{random_.between(-half_m_.x(), half_m_.x()), random_.between(-half_m_.y(), half_m_.y()),
                       random_.between(-M_PI, M_PI)},
                      {random_.between(0.10, 0.30), random_.between(0.08, 0.20)},
                      random_.between(0.16, 0.24),
                      true};
    if (toOuterWall(outlineOf(drawn)) < kPassage_m || !hasRoom(outlineOf(drawn))) return false;
    blocks.push_back(drawn);
    return true;
  }

  bool robot(bool parked) {
    const Pose2 pose{random_.between(-half_m_.x(), half_m_.x()), random_.between(-half_m_.y(), half_m_.y()),
                     random_.between(-M_PI, M_PI)};
    const Polygon outline = motion::placed(pose, body_m_);
    const auto fits = [&](double gap_m) {
      if (parked) return gap_m >= kPassage_m || (gap_m > kBeside_m[0] && gap_m < kBeside_m[1]);
      return gap_m >= kStart_m;
    };
    if (!fits(toOuterWall(outline))) return false;
    for (const Block& other : blocks)
      if (!fits(motion::distanceBetween(outline, outlineOf(other)))) return false;
    for (const Pose2& other : robots)
      if (motion::distanceBetween(outline, motion::placed(other, body_m_)) < kApart_m) return false;
    robots.push_back(pose);
    return true;
  }

  Random random_;
  Eigen::Vector2d half_m_;
  Polygon body_m_;
};

/// Walls, blocks and initial poses of the seed replace those of the arena.
void drawWalls(std::uint32_t seed, YAML::Node& arena) {
  const Eigen::Vector2d half_m(0.5 * arena["floor"]["size_m"][0].as<double>(),
                               0.5 * arena["floor"]["size_m"][1].as<double>());
  std::uint32_t attempt = 0;
  Builder builder(seed, half_m, bodyOf(arena["robots"]["r1"]));
  while (!builder.build())
    builder = Builder(seed + 100000U * ++attempt, half_m, bodyOf(arena["robots"]["r1"]));
  arena["obstacles"] = YAML::Node(YAML::NodeType::Sequence);
  for (const Block& block : builder.blocks) {
    YAML::Node node;
    node["kind"] = "box";
    node["pose"] = nodeOf(block.pose);
    node["size_m"] = flow({block.size_m.x(), block.size_m.y()});
    node["height_m"] = block.height_m;
    node["fixed"] = block.fixed;
    node.SetStyle(YAML::EmitterStyle::Flow);
    arena["obstacles"].push_back(node);
  }
  for (std::size_t i = 0; i < builder.robots.size(); ++i) {
    YAML::Node robot = arena["robots"]["r" + std::to_string(i + 1)];
    robot["initial_pose"] = nodeOf(builder.robots[i]);
    robot.remove("tour");
  }
  arena["random"]["obstacles"] = flow({0, 0});
  arena["random"]["start_jitter_m"] = 0.0;
}

/// The robots that explore begin on their tours, which a seed keeps free.
void drawStarts(std::uint32_t seed, YAML::Node& arena) {
  Random random(seed ^ 0x5eedU);
  std::vector<Pose2> starts;
  while (starts.size() < 2) {
    const YAML::Node tour = arena["robots"][starts.empty() ? "r1" : "r2"]["tour"];
    const auto at = [&](std::size_t i) {
      const YAML::Node place = tour[i % tour.size()];
      return Eigen::Vector2d(place[0].as<double>(), place[1].as<double>());
    };
    const auto leg = static_cast<std::size_t>(random.below(static_cast<int>(tour.size())));
    const double share = random.between(0.0, 1.0);
    const Eigen::Vector2d place_m = (1.0 - share) * at(leg) + share * at(leg + 1);
    if (!starts.empty() && (starts[0].translation() - place_m).norm() < kApart_m) continue;
    starts.push_back({place_m.x(), place_m.y(), random.between(-M_PI, M_PI)});
  }
  arena["robots"]["r1"]["initial_pose"] = nodeOf(starts[0]);
  arena["robots"]["r2"]["initial_pose"] = nodeOf(starts[1]);
}

}  // namespace

std::string writeFleet(std::uint32_t seed, const std::string& arenas, double longest_s,
                       const std::string& out) {
  YAML::Node arena = YAML::LoadFile(arenas + (seed % 4 < 2 ? "/ahmed.yaml" : "/ahmed2.yaml"));
  arena["name"] = fmt::format("exploration_{}", seed);
  if (seed % 2 == 0)
    drawStarts(seed, arena);
  else
    drawWalls(seed, arena);
  dataset::makeDirectories(out);
  dataset::writeAtomic(out + "/arena.yaml", YAML::Dump(arena) + "\n");
  dataset::writeAtomic(out + "/fleet.yaml", fmt::format(R"(name: exploration_{0}
world: {{arena: arena.yaml, seed: {0}, randomised: true, duration_s: {1:.1f}}}
services:
  formation:
    behaviour: exploration
    limits: {{cruise_mps: 0.20, max_turn_radps: 1.0}}
    grid: {{centre_m: [0, 0], size_m: [3.2, 2.2]}}
  global_merger:
    occupancy: {{resolution_m: 0.02}}
)",
                                                        seed, longest_s));
  return out + "/fleet.yaml";
}

}  // namespace omnifleet::exploration
