#include "tests/experiments/loops/pairs.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

namespace omnifleet::loops {
namespace {

constexpr double kBand_m = 0.25, kClose_m = 1.0, kFar_m = 2.0;
constexpr TimeNs kAnotherPass_ns = 20'000'000'000;

/// The same numbers on every platform, unlike std::shuffle.
void shuffle(std::vector<Pair>& pairs, std::mt19937& random) {
  for (std::size_t i = pairs.size(); i > 1; --i) std::swap(pairs[i - 1], pairs[random() % i]);
}

/// Moves `count` random ones of `from` to `to`.
void take(std::vector<Pair> from, int count, std::mt19937& random, std::vector<Pair>& to) {
  shuffle(from, random);
  from.resize(std::min(from.size(), static_cast<std::size_t>(count)));
  to.insert(to.end(), from.begin(), from.end());
}

/// All pairs of frames of a recording: of both robots, or of the only one at different passes.
std::vector<Pair> pairsWithin(const Recording& recording, std::size_t index) {
  std::vector<Pair> pairs;
  const std::size_t other = recording.robots() > 1 ? 1 : 0;
  for (const auto& [row, a] : recording.truth(0)) {
    for (const auto& [other_row, b] : recording.truth(other)) {
      if (other == 0 && b.time_ns - a.time_ns < kAnotherPass_ns) continue;
      Pair pair;
      pair.recording = pair.other_recording = index;
      pair.from = {0, row};
      pair.to = {other, other_row};
      pair.from_to = a.map_from_base.inverse() * b.map_from_base;
      pair.distance_m = pair.from_to.translation().norm();
      // Half of the pairs the other way round, so that neither robot always is the first one.
      if ((row + other_row) % 2 == 1) {
        std::swap(pair.from, pair.to);
        pair.from_to = pair.from_to.inverse();
      }
      pairs.push_back(pair);
    }
  }
  return pairs;
}

FrameId anyFrame(const Recording& recording, std::mt19937& random) {
  const std::size_t robot = random() % recording.robots();
  auto frame = recording.truth(robot).begin();
  std::advance(frame, random() % recording.truth(robot).size());
  return {robot, frame->first};
}

void addWithin(const Recording& recording, std::size_t index, const PairCounts& counts, std::mt19937& random,
               std::vector<Pair>& pairs) {
  std::vector<Pair> all = pairsWithin(recording, index);
  const bool lookalike = recording.kind() == "lookalike";
  const auto select = [&](PairKind kind, double least_m, double most_m, int count) {
    std::vector<Pair> some;
    for (Pair pair : all) {
      if (pair.distance_m < least_m || pair.distance_m >= most_m) continue;
      pair.kind = kind;
      some.push_back(pair);
    }
    take(std::move(some), count, random, pairs);
  };
  if (lookalike) {
    select(PairKind::kLookalike, 0.0, kClose_m, counts.lookalike);
    return;
  }
  for (double least_m = 0.0; least_m < kClose_m; least_m += kBand_m)
    select(PairKind::kClose, least_m, least_m + kBand_m, counts.per_band);
  select(PairKind::kFar, kFar_m, 1e3, counts.far);
}

}  // namespace

const char* toString(PairKind kind) {
  switch (kind) {
    case PairKind::kClose:
      return "close";
    case PairKind::kFar:
      return "far";
    case PairKind::kLookalike:
      return "lookalike";
    case PairKind::kOtherRoom:
      return "other_room";
  }
  return "";
}

std::vector<Pair> choosePairs(const std::vector<Recording>& recordings, const PairCounts& counts,
                              std::uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<Pair> pairs;
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    if (recordings[i].kind() != "disjoint") addWithin(recordings[i], i, counts, random, pairs);
    // Another recording is another room; so is the other robot's in a recording of disjoint rooms.
    for (int k = 0; k < counts.other_room; ++k) {
      Pair pair;
      pair.kind = PairKind::kOtherRoom;
      pair.recording = pair.other_recording = i;
      pair.from = anyFrame(recordings[i], random);
      if (recordings[i].kind() != "disjoint" || k % 2 == 1) {
        if (recordings.size() < 2) continue;
        pair.other_recording = (i + 1 + random() % (recordings.size() - 1)) % recordings.size();
      }
      do pair.to = anyFrame(recordings[pair.other_recording], random);
      while (pair.other_recording == i && pair.to.first == pair.from.first);
      pairs.push_back(pair);
    }
  }
  return pairs;
}

}  // namespace omnifleet::loops
