#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "estimation/loop_check.h"
#include "tests/experiments/loops/pairs.h"

namespace omnifleet::loops {

/// Verdict about one pair.
struct Outcome {
  Pair pair;
  bool compared = false;  ///< both frames have scans
  estimation::LoopCheck::Result result;
  double error_m = 0.0, error_rad = 0.0;  ///< of the relative pose; only of pairs in one room
  double nees = 0.0;                      ///< eᵀP⁻¹e; 3 if consistent
  double check_ms = 0.0;                  ///< time of the check

  bool sameRoom() const { return pair.kind == PairKind::kClose || pair.kind == PairKind::kFar; }
  /// The relative pose is that of the truth: within 10 cm and 3°.
  bool isRight() const;
  bool isFalseClosure() const { return result.closed && !isRight(); }
};

/// Scans around the first place of a pair that count, as the localizer has them: of keyframes on the robot's
/// path. The second place is that of a robot that is searched: it has its own scan.
struct Surroundings {
  double reach_m = 1.5;                                        ///< m, along the path; 0: single scans
  double spacing_m = estimation::KeyframeOptions().spacing_m;  ///< m, between two of them
  double sigma_m = 0.002,
         sigma_rad = 0.001;  ///< errors of their poses relative to the place, Gaussian, seeded
};

/// Scans and signatures of all frames that the pairs need.
class Shots {
 public:
  Shots(const std::vector<Recording>& recordings, const std::vector<Pair>& pairs,
        const Surroundings& surroundings = {});
  /// Null if the frame has no scan.
  const Shot* find(std::size_t recording, const FrameId& frame) const;
  /// Scans around a frame, relative to its base_link.
  std::vector<scan::Reference> around(std::size_t recording, const FrameId& frame) const;

 private:
  const std::vector<Recording>& recordings_;
  Surroundings surroundings_;
  std::vector<std::map<FrameId, Shot>> shots_;
};

std::vector<Outcome> evaluate(const std::vector<Pair>& pairs, const Shots& shots,
                              const estimation::LoopCheckOptions& options, bool use_signatures = true);

/// Table by kind and distance, errors, consistency, reasons of the failures.
std::string report(const std::vector<Outcome>& outcomes);
/// One line per pair.
std::string csv(const std::vector<Recording>& recordings, const std::vector<Outcome>& outcomes);

}  // namespace omnifleet::loops
