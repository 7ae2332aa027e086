#include <algorithm>

#include "adapters/adapters.h"
#include "adapters/common.h"

namespace omnifleet::adapters {
namespace {

bool behaviourFromWire(v1::FormationBehaviour from, motion::Behaviour& to) {
  return enumFromWire(static_cast<std::uint32_t>(from), motion::Behaviour::kExploration, to);
}

void formationViewToWire(const motion::View& from, v1::FormationView& to) {
  to.origin(point(from.origin_m));
  to.blind_m(from.blind_m);
  to.first_rad(from.first_rad);
  to.step_rad(from.step_rad);
  to.ray().assign(from.ray.begin(), from.ray.begin() + static_cast<std::ptrdiff_t>(std::min(
                                                           from.ray.size(), motion::View::kMostRays)));
}

bool formationViewFromWire(const v1::FormationView& from, motion::View& to) {
  to.origin_m = point(from.origin());
  to.blind_m = from.blind_m();
  to.first_rad = from.first_rad();
  to.step_rad = from.step_rad();
  to.ray.assign(from.ray().begin(), from.ray().end());
  return to.origin_m.allFinite() && finite(to.blind_m, to.first_rad, to.step_rad) && to.blind_m >= 0.0f &&
         (to.ray.empty() || (to.step_rad > 0.0f && to.ray.size() <= motion::View::kMostRays));
}

}  // namespace

void toWire(const motion::FormationCommand& from, RunClock clock, v1::FormationCommand& to) {
  to.fleet(from.fleet);
  fillHeader(from.acquired_ns, from.sequence, clock, to.header());
  to.shape(static_cast<v1::FormationShape>(from.shape));
  to.distance_m(from.distance_m);
  to.angle_rad(from.angle_rad);
  sequenceToWire(from.waypoints_m, 64, to.waypoints(),
                 [](const Eigen::Vector2d& waypoint, v1::Point2& wire) { wire = point(waypoint); });
  to.halt(from.halt);
  to.behaviour(static_cast<v1::FormationBehaviour>(from.behaviour));
  to.boundary_m(from.boundary_m);
}

bool fromWire(const v1::FormationCommand& from, motion::FormationCommand& to) {
  to.fleet = from.fleet().to_string();
  to.acquired_ns = from.header().acquired_ns();
  to.sequence = from.header().sequence_number();
  to.shape = static_cast<motion::FormationShape>(from.shape());
  to.distance_m = from.distance_m();
  to.angle_rad = from.angle_rad();
  to.waypoints_m.clear();
  bool good = finite(to.distance_m, to.angle_rad) && to.distance_m > 0.0 &&
              to.shape >= motion::FormationShape::kLine && to.shape <= motion::FormationShape::kTriangle;
  for (const v1::Point2& waypoint : from.waypoints()) {
    to.waypoints_m.push_back(point(waypoint));
    good = good && to.waypoints_m.back().allFinite();
  }
  to.halt = from.halt();
  to.boundary_m = from.boundary_m();
  return behaviourFromWire(from.behaviour(), to.behaviour) && good && finite(to.boundary_m) &&
         to.boundary_m > 0.0;
}

void toWire(const motion::FormationState& from, RunClock clock, v1::FormationState& to) {
  to.robot(from.robot);
  fillHeader(from.acquired_ns, from.sequence, clock, to.header());
  to.role(static_cast<v1::FormationRole>(from.role));
  to.leader(from.leader);
  to.distance_error_m(from.distance_error_m);
  to.angle_error_rad(from.angle_error_rad);
  to.target(point(from.target_m));
  to.avoiding(from.avoiding);
  to.arrived(from.arrived);
  to.term(from.term);
  to.next_waypoint(from.next_waypoint);
  to.command_ns(from.command_ns);
  to.narrowing(from.narrowing);
  to.behaviour(static_cast<v1::FormationBehaviour>(from.behaviour));
  to.ground_clear(from.ground_clear);
  to.stop(pose(from.stop));
  to.has_goal(from.has_goal);
  to.goal(point(from.goal_m));
  to.frontiers(from.frontiers);
  formationViewToWire(from.view, to.view());
  sequenceToWire(from.skipped, motion::SkippedFrontier::kMost, to.skipped(),
                 [](const motion::SkippedFrontier& skipped, v1::SkippedFrontier& wire) {
                   wire.place(point(skipped.place_m));
                   wire.looked(skipped.looked);
                 });
}

bool fromWire(const v1::FormationState& from, motion::FormationState& to) {
  to.robot = from.robot().to_string();
  to.acquired_ns = from.header().acquired_ns();
  to.sequence = from.header().sequence_number();
  to.role = static_cast<motion::FormationRole>(from.role());
  to.leader = from.leader().to_string();
  to.distance_error_m = from.distance_error_m();
  to.angle_error_rad = from.angle_error_rad();
  to.target_m = point(from.target());
  to.avoiding = from.avoiding();
  to.arrived = from.arrived();
  to.term = from.term();
  to.next_waypoint = from.next_waypoint();
  to.command_ns = from.command_ns();
  to.narrowing = from.narrowing();
  to.ground_clear = from.ground_clear();
  to.stop = pose(from.stop());
  to.has_goal = from.has_goal();
  to.goal_m = point(from.goal());
  to.frontiers = from.frontiers();
  bool good = behaviourFromWire(from.behaviour(), to.behaviour) &&
              formationViewFromWire(from.view(), to.view) && to.goal_m.allFinite() && to.stop.isFinite();
  to.skipped.clear();
  for (const v1::SkippedFrontier& skipped : from.skipped()) {
    to.skipped.push_back({point(skipped.place()), skipped.looked()});
    good = good && to.skipped.back().place_m.allFinite();
  }
  return good && finite(to.distance_error_m, to.angle_error_rad, to.narrowing) && to.target_m.allFinite() &&
         to.role >= motion::FormationRole::kLeader && to.role <= motion::FormationRole::kIdle;
}

}  // namespace omnifleet::adapters
