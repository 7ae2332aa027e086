#pragma once

#include <array>
#include <optional>
#include <string>

#include "tests/raycast/room_recording.h"

namespace omnifleet::raycast {

/// What the second robot of a pair without common initial poses shares with the first one.
enum class PairKind {
  kSame,       ///< both drive in one room and see each other
  kLookalike,  ///< another room: the same walls, floor and light, other furniture
  kDisjoint    ///< another room
};
const char* toString(PairKind kind);
/// Throws std::runtime_error if there is no such kind.
PairKind pairKindOf(const std::string& name);

struct FurnishedPair {
  PairKind kind = PairKind::kSame;
  std::array<FurnishedScene, 2> scenes;  ///< of each robot; kSame: one drive, light may differ
  std::optional<Pose2> map_from_r2;      ///< first pose of the second robot; nothing: another room
  double overlap = 0.0;  ///< share of the second robot's frames within 0.8 m of the first's path

  /// Number of a robot (0 or 1) in its scene.
  std::size_t indexInScene(std::size_t robot) const { return kind == PairKind::kSame ? robot : 0; }
};

/// options.seed decides on starts (1.5 m and 45° apart), on how far the paths in one room overlap (60 % or
/// more, 30 to 60 %, 10 to 30 %), and on the light of the second robot's images (equal, or up to 15 %
/// brighter or darker). Throws std::runtime_error like furnishedScene().
FurnishedPair furnishedPair(PairKind kind, const FurnishedOptions& options);

/// Records the pair as r1, which has an initial pose, and r2, which has none. Ground truth as usual is that
/// of r1's room; r2.tum is in the frame of r2's own room if that is another one. groundtruth/pair.json has
/// `kind`, `map_from_r2` ([x, y, theta] or null) and `overlap`; groundtruth/r2/ has the truth of another
/// room.
void recordPair(const std::string& folder, PairKind kind, const FurnishedOptions& options);

}  // namespace omnifleet::raycast
