#include "world/observer.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::world {
namespace {

struct Hit {
  double range_m;
  RayLabel label;
  std::uint16_t object;
};

/// Distances at which a ray enters and leaves an object; infinity when it misses the object.
struct Span {
  double enter_m = INFINITY, leave_m = INFINITY;
};

/// Intersection of a ray with a disc. @param unit direction of the ray, unit length
Span throughDisc(const Eigen::Vector2d& from_m, const Eigen::Vector2d& unit, const Eigen::Vector2d& centre_m,
                 double radius_m) {
  const Eigen::Vector2d to = centre_m - from_m;
  const double along_m = unit.dot(to), offset2 = to.squaredNorm() - along_m * along_m;
  if (along_m <= 0.0 || offset2 >= radius_m * radius_m) return {};
  const double half_m = std::sqrt(radius_m * radius_m - offset2);
  return {std::max(0.0, along_m - half_m), along_m + half_m};
}

/// Intersection of a ray with a box at its pose (slab test).
Span throughBox(const Eigen::Vector2d& from_m, const Eigen::Vector2d& unit, const Pose2& map_from_box,
                const Eigen::Vector2d& size_m) {
  const Pose2 box_from_map = map_from_box.inverse();
  const Eigen::Vector2d start = box_from_map * from_m, way = box_from_map.rotation() * unit;
  double enter_m = 0.0, leave_m = INFINITY;
  for (int axis = 0; axis < 2; ++axis) {
    const double half = 0.5 * size_m[axis];
    if (std::abs(way[axis]) < 1e-12) {
      if (std::abs(start[axis]) > half) return {};
      continue;
    }
    const double a = (-half - start[axis]) / way[axis], b = (half - start[axis]) / way[axis];
    enter_m = std::max(enter_m, std::min(a, b));
    leave_m = std::min(leave_m, std::max(a, b));
  }
  return enter_m <= leave_m ? Span{enter_m, leave_m} : Span{};
}

double bodyRadius(const RobotBody& body) {
  double radius_m = body.radius_m;
  for (const Eigen::Vector2d& vertex : body.footprint_m) radius_m = std::max(radius_m, vertex.norm());
  return radius_m;
}

std::uint16_t trackOf(std::size_t robot) {
  return static_cast<std::uint16_t>(robot + 1);
}

/// Distance at which an object becomes visible; infinity when it is not visible.
double visibleAt(const Span& span, double blind_m) {
  return span.leave_m > blind_m ? std::max(span.enter_m, blind_m) : INFINITY;
}

Hit firstHit(const World& world, std::size_t robot, const Eigen::Vector2d& unit,
             const ObserverOptions& options) {
  const synthetic::Arena& arena = world.arena();
  const double time_s = static_cast<double>(world.now().time_ns - arena.start_ns) * 1e-9;
  const Eigen::Vector2d from_m = world.now().map_from_bases[robot].translation();
  Hit hit{options.range_m, RayLabel::kFloorEnd, 0};
  for (std::size_t i = 0; i < arena.solids.size(); ++i) {
    const synthetic::Solid& solid = arena.solids[i];
    const Pose2 pose = arena.solidAt(static_cast<int>(i), time_s);
    const bool box = solid.kind == synthetic::SolidKind::kBox;
    const double range_m = visibleAt(box ? throughBox(from_m, unit, pose, solid.size_m)
                                         : throughDisc(from_m, unit, pose.translation(), solid.radius_m),
                                     options.blind_m);
    const auto id = static_cast<std::uint16_t>(arena.robots.size() + 1 + i);
    if (range_m < hit.range_m) hit = {range_m, RayLabel::kObstacle, id};
  }
  for (std::size_t i = 0; i < arena.robots.size(); ++i) {
    if (i == robot) continue;
    const Eigen::Vector2d place_m = world.now().map_from_bases[i].translation();
    const double range_m = throughDisc(from_m, unit, place_m, bodyRadius(arena.robots[i].body)).enter_m;
    if (range_m < hit.range_m) hit = {range_m, RayLabel::kRobot, trackOf(i)};
  }
  return hit;
}

Track trackFor(const World& world, std::size_t robot, std::size_t other) {
  const Pose2& own = world.now().map_from_bases[robot];
  Track track;
  track.id = trackOf(other);
  track.kind = ObjectKind::kRobot;
  track.kind_probability = 1.0;
  track.visible = true;
  track.position_m = own.inverse() * world.now().map_from_bases[other].translation();
  const motion::Twist twist = world.twist(other);
  const double heading_rad = world.now().map_from_bases[other].theta_rad - own.theta_rad;
  track.velocity_mps = twist.forward_mps * Eigen::Vector2d(std::cos(heading_rad), std::sin(heading_rad));
  track.covariance = 1e-6 * Eigen::Matrix2d::Identity();
  track.contact_m =
      track.position_m * (1.0 - bodyRadius(world.arena().robots[other].body) / track.position_m.norm());
  return track;
}

}  // namespace

Objects observe(const World& world, std::size_t robot, const ObserverOptions& options) {
  Objects objects;
  objects.robot = world.arena().robots[robot].name;
  objects.acquired_ns = world.now().time_ns;
  objects.sequence = static_cast<std::uint32_t>(world.now().frame);
  const double heading_rad = world.now().map_from_bases[robot].theta_rad;
  objects.scan.blind_m = options.blind_m;
  std::vector<bool> seen(world.arena().robots.size(), false);
  for (int i = 0; i < options.rays; ++i) {
    const double bearing_rad = 2.0 * M_PI * i / options.rays;
    const Eigen::Vector2d unit(std::cos(heading_rad + bearing_rad), std::sin(heading_rad + bearing_rad));
    const Hit hit = firstHit(world, robot, unit, options);
    objects.scan.range_m.push_back(static_cast<float>(hit.range_m));
    objects.scan.sigma_m.push_back(static_cast<float>(options.sigma_m));
    objects.scan.label.push_back(hit.label);
    objects.scan.object.push_back(hit.object);
    if (hit.label == RayLabel::kRobot) seen[hit.object - 1U] = true;
  }
  for (std::size_t other = 0; other < seen.size(); ++other) {
    if (seen[other]) objects.tracks.push_back(trackFor(world, robot, other));
  }
  return objects;
}

Motion exactMotion(const Pose2& map_from_previous, const Pose2& map_from_current, TimeNs since_ns) {
  Motion motion;
  motion.valid = true;
  motion.since_ns = since_ns;
  motion.previous_from_current = map_from_previous.inverse() * map_from_current;
  motion.covariance.setZero();
  return motion;
}

std::vector<PoseEstimate> exactPoses(const World& world) {
  std::vector<PoseEstimate> poses;
  for (std::size_t i = 0; i < world.arena().robots.size(); ++i) {
    PoseEstimate pose;
    pose.robot = world.arena().robots[i].name;
    pose.acquired_ns = world.now().time_ns;
    pose.sequence = static_cast<std::uint32_t>(world.now().frame);
    pose.valid = true;
    pose.map_from_base = world.now().map_from_bases[i];
    pose.covariance = 1e-8 * Eigen::Matrix3d::Identity();
    poses.push_back(pose);
  }
  return poses;
}

}  // namespace omnifleet::world
