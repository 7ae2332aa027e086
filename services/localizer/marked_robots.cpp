#include "localizer/marked_robots.h"

#include <cmath>

namespace omnifleet::localizer {

MarkedOptions MarkedOptions::read(const options::Section& section) {
  MarkedOptions o;
  section.read("distance_m", o.distance_m, {0.0, 100.0});
  section.read("rotation_rad", o.rotation_rad, {0.0, 6.3});
  section.read("interval_s", o.interval_s, {0.0, 3600.0});
  section.finish();
  return o;
}

const std::vector<Objects>& MarkedRobots::framesAt(TimeNs time,
                                                   const std::vector<const Measurement*>& measurements) {
  frames_.clear();
  for (const std::string& robot : robots_) {
    const auto shows = [&](const Measurement* m) {
      return m->kind == MeasurementKind::kAbsolutePose && m->to == robot && m->acquired_ns == time;
    };
    bool is_shown = false;
    for (const Measurement* measurement : measurements) is_shown = is_shown || shows(measurement);
    if (!is_shown) continue;
    Objects& frame = frames_.emplace_back();
    frame.robot = robot;
    frame.acquired_ns = time;
    frame.sequence = sequences_[robot]++;
  }
  return frames_;
}

bool MarkedRobots::isDue(const PoseEstimate& pose) {
  if (!pose.valid) return false;
  const auto last = published_.find(pose.robot);
  if (last != published_.end()) {
    const Pose2 way = last->second.map_from_base.inverse() * pose.map_from_base;
    const double passed_s = static_cast<double>(pose.acquired_ns - last->second.acquired_ns) * 1e-9;
    const bool moved =
        way.translation().norm() >= options_.distance_m || std::abs(way.theta_rad) >= options_.rotation_rad;
    if (!moved && passed_s < options_.interval_s) return false;
  }
  published_[pose.robot] = pose;
  return true;
}

}  // namespace omnifleet::localizer
