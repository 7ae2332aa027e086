#include "formation/shared_grid.h"

#include <algorithm>
#include <tuple>

#include "motion/motion_guard.h"

namespace omnifleet::formation {
namespace {

constexpr std::size_t kMostPoses = 16;  // per robot: as many as a live stream keeps
constexpr TimeNs kParked_ns = -1;

}  // namespace

SharedGrid::SharedGrid(const motion::ExplorationGrid::Options& options,
                       const std::map<std::string, RobotBody>& bodies)
    : grid_(options), bodies_(bodies) {
  for (const auto& [robot, body] : bodies) outlines_m_[robot] = body.outline();
}

void SharedGrid::park(const std::map<std::string, Pose2>& map_from_bases) {
  for (const auto& [robot, pose] : map_from_bases) {
    if (!bodies_.count(robot)) continue;
    poses_[robot].assign(1, {kParked_ns, pose});
    grid_.stand(outline(robot, pose));
  }
}

Polygon SharedGrid::outline(const std::string& robot, const Pose2& map_from_base) const {
  return motion::placed(map_from_base, outlines_m_.at(robot));
}

std::optional<Pose2> SharedGrid::pose(const std::string& robot) const {
  const auto found = poses_.find(robot);
  if (found == poses_.end() || found->second.empty()) return std::nullopt;
  return found->second.back().map_from_base;
}

std::optional<Pose2> SharedGrid::poseAt(const std::string& robot, TimeNs time_ns) const {
  const auto found = poses_.find(robot);
  if (found == poses_.end()) return std::nullopt;
  for (const Timed& timed : found->second) {
    if (timed.acquired_ns == time_ns) return timed.map_from_base;
  }
  return std::nullopt;
}

void SharedGrid::learn(const std::vector<PoseEstimate>& poses,
                       const std::vector<motion::FormationState>& states) {
  for (const PoseEstimate& pose : poses) {
    if (!pose.valid || !pose.frame.empty() || !pose.map_from_base.isFinite() || !bodies_.count(pose.robot)) continue;
    std::deque<Timed>& known = poses_[pose.robot];
    if (!known.empty() && pose.acquired_ns <= known.back().acquired_ns) continue;
    known.push_back({pose.acquired_ns, pose.map_from_base});
    if (known.size() > kMostPoses) known.pop_front();
    const double reach_m = motion::reachOf(outlines_m_.at(pose.robot));
    // Robots are placed where they can turn.
    if (!std::exchange(placed_[pose.robot], true))
      grid_.assumeFree(pose.map_from_base.translation(), reach_m + grid_.cell_m());
    grid_.stand(outline(pose.robot, pose.map_from_base));
  }
  std::vector<const motion::FormationState*> ready;
  for (const motion::FormationState& state : states) {
    if (!bodies_.count(state.robot)) continue;
    pending_[state.robot].push_back(state);
    if (pending_[state.robot].size() > kMostPoses) pending_[state.robot].pop_front();
  }
  for (auto& [robot, waiting] : pending_) {
    for (const motion::FormationState& state : waiting) {
      if (poseAt(robot, state.acquired_ns)) ready.push_back(&state);
    }
  }
  std::sort(ready.begin(), ready.end(), [](const auto* a, const auto* b) {
    return std::tie(a->acquired_ns, a->robot) < std::tie(b->acquired_ns, b->robot);
  });
  for (const motion::FormationState* state : ready) draw(*state, *poseAt(state->robot, state->acquired_ns));
  for (auto& [robot, waiting] : pending_) {
    while (!waiting.empty() && stated_.count(robot) &&
           waiting.front().acquired_ns <= stated_.at(robot).state.acquired_ns)
      waiting.pop_front();
  }
}

void SharedGrid::draw(const motion::FormationState& state, const Pose2& map_from_base) {
  const auto before = stated_.find(state.robot);
  if (before != stated_.end() && state.acquired_ns <= before->second.state.acquired_ns) return;
  std::vector<Polygon> others_m;
  for (const auto& [robot, outline_m] : outlines_m_) {
    if (robot == state.robot) continue;
    std::optional<Pose2> there = poseAt(robot, state.acquired_ns);
    if (!there) there = pose(robot);
    if (there) others_m.push_back(motion::placed(*there, outline_m));
  }
  grid_.see(map_from_base, state.view, others_m);
  stated_[state.robot] = {state, map_from_base};
}

}  // namespace omnifleet::formation
