#pragma once

#include <map>
#include <vector>

#include "dataset/trajectory_files.h"

namespace omnifleet::evaluation {

/// Frames of one robot with one localization state, and the errors of their poses against the truth.
struct StateMetrics {
  int frames = 0;
  double share = 0.0;                                    ///< of all frames of the robot; NaN without frames
  int poses = 0;                                         ///< of these frames, those with pose and truth
  double mean_m = 0.0, max_m = 0.0;                      ///< distance; NaN without poses
  double mean_heading_rad = 0.0, max_heading_rad = 0.0;  ///< |Δθ|; NaN without poses
};

/// Events of one kind.
struct EventMetrics {
  int count = 0;
  double largest_sigmas = 0.0;  ///< largest correction, σ of the prediction
};

/// Shares of the rows in which a source was used, or rejected.
struct SourceMetrics {
  double used = 0.0, rejected = 0.0;
};

struct LocalizationMetrics {
  int frames = 0;         ///< number of frames to which the shares refer
  int without_state = 0;  ///< frames of the recording without a row, e.g. before a restart of the merger
  std::map<LocalizationState, StateMetrics> states;  ///< all states, also those without frames
  std::map<PoseEvent, EventMetrics> events;          ///< kinds that occurred; never kNone
  std::map<Source, SourceMetrics> sources;           ///< those that were used or rejected at all
};

/// Groups the errors of a path by the localization state of each frame. Rows and poses are matched by equal
/// times; of several rows with one time the first counts. The truth is interpolated as in poseAt().
/// @param frames number of frames of the recording; 0 if unknown. The shares then refer to the rows, as they
///     do if there are more rows than frames.
LocalizationMetrics compareLocalization(const std::vector<dataset::StampedLocalization>& rows,
                                        const std::vector<dataset::StampedPose>& truth,
                                        const std::vector<dataset::StampedPose>& estimate, int frames,
                                        TimeNs max_gap_ns = 1'000'000'000);

}  // namespace omnifleet::evaluation
