#include "evaluation/localization_metrics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "evaluation/trajectory_metrics.h"

namespace omnifleet::evaluation {
namespace {

/// Errors of the poses of one state.
struct StateErrors {
  std::vector<double> distance_m, heading_rad;
};

void setErrors(const StateErrors& errors, StateMetrics& metrics) {
  const Statistics distance = Statistics::of(errors.distance_m);
  const Statistics heading = Statistics::of(errors.heading_rad);
  metrics.poses = distance.count;
  metrics.mean_m = distance.mean;
  metrics.max_m = distance.max;
  metrics.mean_heading_rad = heading.mean;
  metrics.max_heading_rad = heading.max;
}

void addEvent(const dataset::StampedLocalization& row, std::map<PoseEvent, EventMetrics>& events) {
  if (row.event == PoseEvent::kNone) return;
  EventMetrics& event = events[row.event];
  ++event.count;
  event.largest_sigmas = std::max(event.largest_sigmas, row.correction_sigmas);
}

void addSources(const dataset::StampedLocalization& row, std::map<Source, SourceMetrics>& sources) {
  for (const Source source : kSources) {
    if (row.used.has(source)) sources[source].used += 1.0;
    if (row.rejected.has(source)) sources[source].rejected += 1.0;
  }
}

}  // namespace

LocalizationMetrics compareLocalization(const std::vector<dataset::StampedLocalization>& rows,
                                        const std::vector<dataset::StampedPose>& truth,
                                        const std::vector<dataset::StampedPose>& estimate, int frames,
                                        TimeNs max_gap_ns) {
  std::map<TimeNs, Pose2> pose_at;
  for (const dataset::StampedPose& pose : estimate) pose_at.emplace(pose.time_ns, pose.map_from_base);
  LocalizationMetrics result;
  std::map<LocalizationState, StateErrors> errors;
  std::set<TimeNs> times;
  for (const dataset::StampedLocalization& row : rows) {
    if (!times.insert(row.time_ns).second) continue;
    ++result.states[row.state].frames;
    addEvent(row, result.events);
    addSources(row, result.sources);
    const auto pose = pose_at.find(row.time_ns);
    Pose2 true_pose;
    if (pose == pose_at.end() || !poseAt(truth, row.time_ns, max_gap_ns, true_pose)) continue;
    StateErrors& of_state = errors[row.state];
    of_state.distance_m.push_back((pose->second.translation() - true_pose.translation()).norm());
    of_state.heading_rad.push_back(std::abs(wrapAngle(pose->second.theta_rad - true_pose.theta_rad)));
  }
  const int with_state = static_cast<int>(times.size());
  for (auto& [source, metrics] : result.sources) {
    metrics.used /= with_state;
    metrics.rejected /= with_state;
  }
  result.frames = std::max(frames, with_state);
  result.without_state = result.frames - with_state;
  for (const LocalizationState state : dataset::kLocalizationStates) {
    StateMetrics& metrics = result.states[state];
    metrics.share = result.frames > 0 ? static_cast<double>(metrics.frames) / result.frames
                                      : std::numeric_limits<double>::quiet_NaN();
    setErrors(errors[state], metrics);
  }
  return result;
}

}  // namespace omnifleet::evaluation
