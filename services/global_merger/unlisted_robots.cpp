#include "global_merger/unlisted_robots.h"

#include <algorithm>

namespace omnifleet::global_merger {
namespace {

constexpr double kDriven_m = 0.3;        // m driven at least: larger than any error of an outline
constexpr std::size_t kLeastPlaces = 4;  // views at least: errors of an outline do not spread over so many
constexpr double kLargestStep =
    0.6;  // largest step as a share of the distance driven: a larger step means two objects
constexpr double kSame_m = 0.12;  // m between the places of one body seen by two robots
constexpr double kMostly = 0.8;   // share of the views of a track

bool drove(const std::vector<ObjectView>& views) {
  if (views.size() < kLeastPlaces) return false;
  double way_m = 0.0, step_m = 0.0;
  for (std::size_t i = 1; i < views.size(); ++i) {
    way_m = std::max(way_m, (views[i].position_m - views[0].position_m).norm());
    step_m = std::max(step_m, (views[i].position_m - views[i - 1].position_m).norm());
  }
  return way_m > kDriven_m && step_m < kLargestStep * way_m;
}

/// Views in order of time. Between two views its place is unknown; after the last view it remains there.
bool isAt(const std::vector<ObjectView>& unlisted_robot, const ObjectView& view) {
  const auto after =
      std::upper_bound(unlisted_robot.begin(), unlisted_robot.end(), view.time_ns,
                       [](TimeNs time_ns, const ObjectView& v) { return time_ns < v.time_ns; });
  const auto isNear = [&](const ObjectView& v) { return (v.position_m - view.position_m).norm() < kSame_m; };
  return (after != unlisted_robot.begin() && isNear(*std::prev(after))) ||
         (after != unlisted_robot.begin() && after != unlisted_robot.end() && isNear(*after));
}

}  // namespace

void findUnlistedRobots(std::vector<Candidate>& candidates) {
  std::vector<const Candidate*> unlisted_robots;
  for (const Candidate& candidate : candidates) {
    if (candidate.kind == ObjectKind::kRobot && drove(candidate.views)) unlisted_robots.push_back(&candidate);
  }
  for (Candidate& candidate : candidates) {
    if (candidate.kind == ObjectKind::kRobot) continue;
    const bool is_one =
        std::any_of(unlisted_robots.begin(), unlisted_robots.end(), [&](const Candidate* unlisted_robot) {
          const auto there =
              std::count_if(candidate.views.begin(), candidate.views.end(),
                            [&](const ObjectView& view) { return isAt(unlisted_robot->views, view); });
          return static_cast<double>(there) >= kMostly * static_cast<double>(candidate.views.size());
        });
    if (is_one) candidate.kind = ObjectKind::kRobot;
  }
}

}  // namespace omnifleet::global_merger
