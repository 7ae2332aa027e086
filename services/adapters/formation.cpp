#include "adapters/adapters.h"
#include "adapters/common.h"

namespace omnifleet::adapters {

void toWire(const motion::FormationCommand& from, RunClock clock, v1::FormationCommand& to) {
  to.fleet(from.fleet);
  fillHeader(from.acquired_ns, from.sequence, clock, to.header());
  to.shape(static_cast<v1::FormationShape>(from.shape));
  to.distance_m(from.distance_m);
  to.angle_rad(from.angle_rad);
  sequenceToWire(from.waypoints_m, 64, to.waypoints(),
                 [](const Eigen::Vector2d& waypoint, v1::Point2& wire) { wire = point(waypoint); });
  to.halt(from.halt);
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
  return good;
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
  return finite(to.distance_error_m, to.angle_error_rad, to.narrowing) && to.target_m.allFinite() &&
         to.role >= motion::FormationRole::kLeader && to.role <= motion::FormationRole::kIdle;
}

}  // namespace omnifleet::adapters
