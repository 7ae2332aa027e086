#include "global_merger/strangers.h"

#include <algorithm>

namespace omnifleet::global_merger {
namespace {

constexpr double kDriven_m = 0.3;        // at least: no error of an outline is as large …
constexpr std::size_t kLeastPlaces = 4;  // … nor spread over so many views …
constexpr double kLargestStep = 0.6;     // … of the way at most from one to the next: else two things
constexpr double kSame_m = 0.12;         // between the places of one body seen by two
constexpr double kMostly = 0.8;          // of the views of a track

bool drove(const std::vector<ObjectView>& views) {
  if (views.size() < kLeastPlaces) return false;
  double way_m = 0.0, step_m = 0.0;
  for (std::size_t i = 1; i < views.size(); ++i) {
    way_m = std::max(way_m, (views[i].position_m - views[0].position_m).norm());
    step_m = std::max(step_m, (views[i].position_m - views[i - 1].position_m).norm());
  }
  return way_m > kDriven_m && step_m < kLargestStep * way_m;
}

/// In order of time; what it did between two views nobody knows, after the last one it stands.
bool isAt(const std::vector<ObjectView>& stranger, const ObjectView& view) {
  const auto after =
      std::upper_bound(stranger.begin(), stranger.end(), view.time_ns,
                       [](TimeNs time_ns, const ObjectView& v) { return time_ns < v.time_ns; });
  const auto isNear = [&](const ObjectView& v) { return (v.position_m - view.position_m).norm() < kSame_m; };
  return (after != stranger.begin() && isNear(*std::prev(after))) ||
         (after != stranger.begin() && after != stranger.end() && isNear(*after));
}

}  // namespace

void tellStrangers(std::vector<Candidate>& candidates) {
  std::vector<const Candidate*> strangers;
  for (const Candidate& candidate : candidates) {
    if (candidate.kind == ObjectKind::kRobot && drove(candidate.views)) strangers.push_back(&candidate);
  }
  for (Candidate& candidate : candidates) {
    if (candidate.kind == ObjectKind::kRobot) continue;
    const bool is_one = std::any_of(strangers.begin(), strangers.end(), [&](const Candidate* stranger) {
      const auto there = std::count_if(candidate.views.begin(), candidate.views.end(),
                                       [&](const ObjectView& view) { return isAt(stranger->views, view); });
      return static_cast<double>(there) >= kMostly * static_cast<double>(candidate.views.size());
    });
    if (is_one) candidate.kind = ObjectKind::kRobot;
  }
}

}  // namespace omnifleet::global_merger
