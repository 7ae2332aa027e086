#include "occupancy/robot_paths.h"

#include <algorithm>
#include <cstdlib>
#include <iterator>

namespace omnifleet::occupancy {
namespace {

/// Interpolates between two integers, rounded to nearest. `part` and `whole` in microseconds, truncated.
std::int64_t between(std::int64_t a, std::int64_t b, std::int64_t part, std::int64_t whole) {
  return a + floorDivide((b - a) * part + whole / 2, whole);
}

IntegerPose interpolate(const IntegerPose& a, const IntegerPose& b, TimeNs part_ns, TimeNs whole_ns) {
  const std::int64_t part = part_ns / 1000, whole = std::max<std::int64_t>(whole_ns / 1000, 1);
  // The shorter rotation, as a signed fraction of a turn, converted to 0.1 mrad (rounded to nearest).
  const auto turn = static_cast<std::int32_t>(turnFromDmrad(b.theta_dmrad) - turnFromDmrad(a.theta_dmrad));
  const std::int64_t way_dmrad =
      floorDivide(std::int64_t{turn} * 62832 + (std::int64_t{1} << 31U), std::int64_t{1} << 32U);
  IntegerPose now;
  now.position.x_dmm = static_cast<std::int32_t>(between(a.position.x_dmm, b.position.x_dmm, part, whole));
  now.position.y_dmm = static_cast<std::int32_t>(between(a.position.y_dmm, b.position.y_dmm, part, whole));
  now.theta_dmrad = static_cast<std::int32_t>(a.theta_dmrad + between(0, way_dmrad, part, whole));
  now.sigma_dmm = std::max(a.sigma_dmm, b.sigma_dmm);
  now.sigma_dmrad = std::max(a.sigma_dmrad, b.sigma_dmrad);
  return now;
}

}  // namespace

std::optional<IntegerPose> integerPoseOf(const KeyframePose* pose) {
  if (pose == nullptr) return std::nullopt;
  return IntegerPose{pose->position, pose->theta_dmrad, pose->sigma_dmm, pose->sigma_dmrad};
}

std::optional<IntegerPose> RobotPaths::at(const std::string& robot, TimeNs time_ns) const {
  const auto* path = store_.find(robot);
  if (path == nullptr) return std::nullopt;
  auto after = path->lower_bound(time_ns);
  auto before = after;
  while (after != path->end() && !poseOf(after->second)) ++after;
  std::optional<IntegerPose> late, early;
  if (after != path->end()) late = poseOf(after->second);
  if (late && after->first == time_ns) return late;
  while (before != path->begin() && !early) early = poseOf((--before)->second);
  if (early && late && after->first - before->first <= max_gap_ns_) {
    return interpolate(*early, *late, time_ns - before->first, after->first - before->first);
  }
  const TimeNs since = early ? time_ns - before->first : hold_ns_ + 1;
  const TimeNs until = late ? after->first - time_ns : hold_ns_ + 1;
  if (std::min(since, until) > hold_ns_) return std::nullopt;
  return since <= until ? early : late;
}

std::pair<TimeNs, TimeNs> RobotPaths::influence(const std::string& robot, TimeNs time_ns) const {
  const TimeNs reach = std::max(hold_ns_, max_gap_ns_);
  TimeNs first = time_ns - reach, last = time_ns + reach;
  const auto* path = store_.find(robot);
  if (path == nullptr) return {first, last};
  auto after = path->upper_bound(time_ns);
  while (after != path->end() && after->first <= last && !poseOf(after->second)) ++after;
  if (after != path->end()) last = std::min(last, after->first);
  auto before = path->lower_bound(time_ns);
  while (before != path->begin() && before->first >= first) {
    --before;
    if (!poseOf(before->second)) continue;
    first = std::max(first, before->first);
    break;
  }
  return {first, last};
}

}  // namespace omnifleet::occupancy
