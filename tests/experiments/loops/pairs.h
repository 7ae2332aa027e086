#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "geometry/pose2.h"
#include "tests/experiments/loops/recording.h"

namespace omnifleet::loops {

enum class PairKind {
  kClose,      ///< positive: one room, at most 1 m apart
  kFar,        ///< one room, more than 2 m apart: open, or closed with the right relative pose
  kLookalike,  ///< negative: rooms with equal walls, at most 1 m apart in them
  kOtherRoom   ///< negative
};
const char* toString(PairKind kind);

/// Two frames to compare; both indices count the recordings of the study.
struct Pair {
  PairKind kind = PairKind::kClose;
  std::size_t recording = 0, other_recording = 0;
  FrameId from, to;
  Pose2 from_to;            ///< truth; not of other rooms
  double distance_m = 0.0;  ///< in the frame of the room(s); of other rooms 0
};

/// Numbers of pairs per recording.
struct PairCounts {
  int per_band = 4;  ///< of each band of 0.25 m up to 1 m: close pairs, where the paths have any
  int far = 2, lookalike = 12, other_room = 6;
};

/// Chooses pairs at random, the same ones for the same recordings and seed. Close pairs are of different
/// robots, or of one robot at least 20 s apart (another pass).
std::vector<Pair> choosePairs(const std::vector<Recording>& recordings, const PairCounts& counts,
                              std::uint32_t seed);

}  // namespace omnifleet::loops
