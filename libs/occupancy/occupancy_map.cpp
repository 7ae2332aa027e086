#include "occupancy/occupancy_map.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <set>

#include "occupancy/body_mask.h"
#include "occupancy/cell_counts.h"
#include "occupancy/layer_octree.h"
#include "occupancy/ray_window.h"
#include "occupancy/robot_paths.h"
#include "occupancy/track_kinds.h"
#include "occupancy/visible_map.h"
#include "occupancy/voxel_counts.h"

namespace omnifleet::occupancy {

RayLimits rayLimitsOf(const OccupancyOptions& options) {
  return {std::llround(options.resolution_m * kDmmPerMetre), std::llround(options.max_range_m * kDmmPerMetre),
          std::llround(std::min(options.hit_cells, options.most_hit_sigma_m / options.resolution_m) * 1000.0),
          std::llround(options.free_sigmas * 1000.0)};
}

OccupancyOptions OccupancyOptions::read(const options::Section& section) {
  OccupancyOptions o;
  section.read("resolution_m", o.resolution_m, {0.005, 1.0});
  section.read("max_range_m", o.max_range_m, {0.1, 30.0});
  section.read("bucket_s", o.bucket_s, {0.01, 3600.0});
  section.read("probability_hit", o.probability_hit, {0.501, 0.999});
  section.read("probability_miss", o.probability_miss, {0.001, 0.499});
  section.read("clamp_min", o.clamp_min, {0.001, 0.499});
  section.read("clamp_max", o.clamp_max, {0.501, 0.999});
  section.read("robot_margin_m", o.robot_margin_m, {0.0, 1.0});
  section.read("robot_sigmas", o.robot_sigmas, {0.0, 10.0});
  section.read("most_robot_margin_m", o.most_robot_margin_m, {0.0, 10.0});
  section.read("robot_window_m", o.robot_window_m, {0.0, 10.0});
  section.read("driven_is_free", o.driven_is_free);
  section.read("hold_s", o.hold_s, {0.0, 60.0});
  section.read("max_gap_s", o.max_gap_s, {0.0, 60.0});
  section.read("default_radius_m", o.default_radius_m, {0.01, 5.0});
  section.read("unknown_is_hit", o.unknown_is_hit);
  section.read("hit_cells", o.hit_cells, {0.0, 100.0});
  section.read("most_hit_sigma_m", o.most_hit_sigma_m, {0.0, 10.0});
  section.read("free_sigmas", o.free_sigmas, {0.0, 10.0});
  section.read("least_share", o.least_share, {0.0, 0.5});
  section.read("least_gap_m", o.least_gap_m, {0.0, 1.0});
  o.mirrors = structure::MirrorOptions::read(section.child("mirrors"));
  section.read("least_point_hits", o.least_point_hits, {1, 1000});
  if (std::abs(o.resolution_m * 1e4 - std::round(o.resolution_m * 1e4)) > 1e-6) {
    section.fail("resolution_m", "must be a multiple of 0.0001");
  }
  section.finish();
  return o;
}

constexpr std::size_t kAll = std::numeric_limits<std::size_t>::max();

class OccupancyMap::Impl {
 public:
  Impl(const OccupancyOptions& given, const std::map<std::string, RobotBody>& bodies, std::string frame)
      : options(given),
        resolution_dmm(static_cast<std::int32_t>(std::lround(given.resolution_m * 1e4))),
        bucket_ns(std::llround(given.bucket_s * 1e9)),
        store(std::move(frame)),
        cells(given),
        voxels(given),
        octree(given.resolution_m),
        paths(store, std::llround(given.hold_s * 1e9), std::llround(given.max_gap_s * 1e9)),
        window(rayLimitsOf(given)),
        default_mask(maskOf(RobotBody{})),
        robot_permille(std::llround(given.robot_sigmas * 1000.0)),
        most_margin_dmm(std::llround(given.most_robot_margin_m * kDmmPerMetre)),
        margin_dmm(std::llround(given.robot_margin_m * kDmmPerMetre)) {
    for (const auto& [robot, body] : bodies) {
      masks.emplace(robot, maskOf(body));
      footprints.emplace(robot, BodyMask(body, 0.0, options.default_radius_m));
      if (body.radius_m > 0.0 || body.footprint_m.size() >= 3) given_bodies.insert(robot);
    }
    on_change = [this](std::int64_t, std::int64_t, CellClass) { ++class_changes; };
  }

  bool add(const Contribution& contribution);
  bool add(const KeyframePose& pose);
  bool correct(std::size_t at_most);
  void overrideKinds(const std::map<std::pair<std::string, std::uint32_t>, ObjectKind>& kinds_given);

  OccupancyOptions options;
  std::int32_t resolution_dmm;
  std::int64_t bucket_ns;
  ContributionStore store;
  TrackKinds kinds;
  CellCounts cells;
  VoxelCounts voxels;
  LayerOctree octree;
  structure::SurfaceMap visible;  ///< as of the last call of freshVisible(); in the octree
  bool is_visible_stale = true;
  RobotPaths paths;
  RayWindow window;
  std::map<std::string, BodyMask> masks, footprints;  ///< with margin; without
  std::set<std::string> given_bodies;                 ///< robots whose body is known
  BodyMask default_mask;
  AppliedSet applied;
  CellCounts::OnChange on_change;
  std::uint64_t class_changes = 0;
  std::int64_t robot_permille, most_margin_dmm, margin_dmm;  ///< robot_sigmas in thousandths; two margins
  bool correct_later = false;                                ///< corrections are left to correctSome()

  const structure::SurfaceMap& freshVisible();

 private:
  BodyMask maskOf(const RobotBody& body) const {
    if (const double half = 0.5 * options.robot_window_m; half > 0.0) {
      RobotBody square;
      square.footprint_m = {{-half, -half}, {half, -half}, {half, half}, {-half, half}};
      return {square, 0.0, half};
    }
    // A cell counts as under the robot if any part of it is: the margin grows by half a diagonal.
    return {body, options.robot_margin_m + 0.5 * std::sqrt(2.0) * options.resolution_m,
            options.default_radius_m};
  }
  /// How far the edge of a body may lie from its place by the σ of its pose, 0.1 mm.
  std::int64_t sigmaMargin(const BodyMask& body, const IntegerPose& at) const {
    return (at.sigma_dmm + body.reachDmm() * at.sigma_dmrad / 10000) * robot_permille / 1000;
  }
  /// Added to the margin of a robot's footprint because its pose is uncertain, 0.1 mm.
  std::int64_t marginOf(const BodyMask& body, const IntegerPose& at) const {
    return options.robot_window_m > 0.0 ? 0 : std::min(sigmaMargin(body, at), most_margin_dmm);
  }
  const BodyMask& maskOf(const std::string& robot) const {
    const auto found = masks.find(robot);
    return found == masks.end() ? default_mask : found->second;
  }
  std::optional<Applied> wanted(const std::string& robot, TimeNs time_ns) const;
  void refresh(const std::string& robot, TimeNs time_ns);
  void refreshBetween(TimeNs first_ns, TimeNs last_ns);
  void refreshAll(const std::string& robot);
  void placePoints(const std::vector<Sighting>& sightings, Applied& what) const;
  void placeBody(Applied& what) const;
  void coverBody(const Applied& what);
  void cutRays(Applied& what) const;
  bool bring(const std::optional<Applied>& now, Applied& old);
  void enter(const Applied& what, int sign);
  void coverAll(const Applied& what, std::uint8_t bit);
  std::int64_t bucketOf(const Applied& what) const {
    return floorDivide(what.contribution->acquired_ns, bucket_ns);
  }
};

bool OccupancyMap::Impl::add(const Contribution& contribution) {
  const auto* before = store.find(contribution.robot, contribution.acquired_ns);
  const bool replaces = before != nullptr && before->contribution != nullptr;
  if (!store.add(contribution)) return false;
  if (replaces) {  // another contribution of the same robot and time: the kinds of all tracks are rebuilt
    kinds = kinds.rebuilt(store);
    for (const auto& [robot, path] : store.robots()) refreshAll(robot);
  } else if (kinds.learn(contribution)) {
    refreshAll(contribution.robot);
  }
  refresh(contribution.robot, contribution.acquired_ns);
  return true;
}

bool OccupancyMap::Impl::correct(std::size_t at_most) {
  const auto corrected = store.correctNext(at_most);
  for (const auto& [robot, time_ns] : corrected) refresh(robot, time_ns);
  return !corrected.empty();
}

bool OccupancyMap::Impl::add(const KeyframePose& pose) {
  if (!store.add(pose)) return false;
  if (!correct_later) correct(kAll);
  const auto [first_ns, last_ns] = paths.influence(pose.robot, pose.acquired_ns);
  refreshBetween(first_ns, last_ns);
  return true;
}

void OccupancyMap::Impl::overrideKinds(
    const std::map<std::pair<std::string, std::uint32_t>, ObjectKind>& kinds_given) {
  correct(kAll);
  for (const auto& robot : kinds.overrideKinds(kinds_given)) refreshAll(robot);
}

/// How one contribution is to be applied according to the sets; nothing while it or its pose in the map is
/// missing.
std::optional<Applied> OccupancyMap::Impl::wanted(const std::string& robot, TimeNs time_ns) const {
  const auto* keyframe = store.find(robot, time_ns);
  if (keyframe == nullptr || !keyframe->contribution) return std::nullopt;
  const auto at = integerPoseOf(store.poseOf(*keyframe));
  if (!at) return std::nullopt;
  Applied what;
  what.contribution = keyframe->corrected;
  what.at = *at;
  what.roles = rolesOf(*keyframe->contribution, keyframe->pose->sightings, kinds, options.unknown_is_hit);
  for (const auto& [other, path] : store.robots()) {
    const auto robot_pose = paths.at(other, time_ns);
    if (!robot_pose) continue;
    const BodyMask& mask = maskOf(other);
    if (!window.isNear(mask, *robot_pose, marginOf(mask, *robot_pose), *what.contribution, what.at)) continue;
    const bool has_window = options.robot_window_m > 0.0;
    if (has_window && other == robot) continue;
    what.robots.emplace_back(other, *robot_pose);
    if (has_window) what.robots.back().second.theta_dmrad = 0;
  }
  placeBody(what);
  cutRays(what);
  placePoints(keyframe->pose->sightings, what);
  return what;
}

/// Ends the rays that cross the footprint of another robot there: what they show behind it is wrong. A ray
/// whose end lies on it within its error may have ended at the robot.
void OccupancyMap::Impl::cutRays(Applied& what) const {
  if (options.robot_window_m > 0.0) return;
  const Contribution& seen = *what.contribution;
  const PointDmm origin = scanOrigin(seen, what.at);
  const std::int64_t free_permille = rayLimitsOf(options).free_permille;
  const auto count = static_cast<std::uint32_t>(what.roles.size());
  for (const auto& [robot, at] : what.robots) {
    const auto footprint = footprints.find(robot);
    if (robot == seen.robot || footprint == footprints.end()) continue;
    const std::int64_t more = marginOf(footprint->second, at) + margin_dmm;
    const Turn heading = turnFromDmrad(at.theta_dmrad);
    const PointDmm from =
        unrotate(directionOf(heading), {origin.x_dmm - at.position.x_dmm, origin.y_dmm - at.position.y_dmm});
    const Turn to_scan = turnFromDmrad(what.at.theta_dmrad) - heading;
    for (std::uint32_t i = 0; i < count; ++i) {
      if (what.roles[i] == RayRole::kNone) continue;
      const auto entry = footprint->second.entry(from, directionOf(to_scan + turnOfBearing(i, count)), more);
      if (!entry) continue;
      const std::int64_t range = rangeOf(seen, i, what.cuts);
      const std::int64_t sigma = i < seen.sigma_dmm.size() ? seen.sigma_dmm[i] : 0;
      const std::int64_t error = sigma * free_permille / 1000;
      if (*entry >= range + error) continue;
      if (what.cuts.empty()) what.cuts.assign(count, 0);
      const std::int64_t end = std::min(*entry, range - error);
      what.cuts[i] = static_cast<std::int32_t>(std::max<std::int64_t>(end, 1));
    }
  }
}

/// Adds the voxels of its points, except points of robots, undecided objects and floor markings, and points
/// where a robot was.
void OccupancyMap::Impl::placePoints(const std::vector<Sighting>& sightings, Applied& what) const {
  VoxelKey key{};
  for (const SurfacePoint& point : what.contribution->points) {
    const ObjectKind kind = kinds.kindOf(what.contribution->robot, point.track);
    const bool sighted = std::any_of(sightings.begin(), sightings.end(), [&](const Sighting& s) {
      return static_cast<std::uint16_t>(s.track_id) == point.track;
    });
    if (sighted || kinds.isFloorMarking(what.contribution->robot, point.track)) continue;
    if (kind == ObjectKind::kRobot || (kind == ObjectKind::kUnknown && !options.unknown_is_hit)) continue;
    if (!voxels.keyOf(point, *what.contribution, what.at, key)) continue;
    const auto middle = [&](std::int64_t cell) {
      return static_cast<std::int32_t>(cell * resolution_dmm + resolution_dmm / 2);
    };
    const bool covered = std::any_of(what.robots.begin(), what.robots.end(), [&](const auto& entry) {
      const IntegerPose& at = entry.second;
      const PointDmm from_robot{middle(key.x) - at.position.x_dmm, middle(key.y) - at.position.y_dmm};
      return maskOf(entry.first)
          .covers(unrotate(directionOf(turnFromDmrad(at.theta_dmrad)), from_robot),
                  marginOf(maskOf(entry.first), at));
    });
    if (!covered) what.voxels.push_back(key);
  }
  std::sort(what.voxels.begin(), what.voxels.end());
  what.voxels.erase(std::unique(what.voxels.begin(), what.voxels.end()), what.voxels.end());
}

/// Updates the cells to what the sets say about one contribution.
void OccupancyMap::Impl::refresh(const std::string& robot, TimeNs time_ns) {
  const auto now = wanted(robot, time_ns);
  const auto found = applied.find({robot, time_ns});
  if (found == applied.end()) {
    if (!now) return;
    const Applied& what = applied.emplace(std::pair{robot, time_ns}, *now).first->second;
    enter(what, 1);
    voxels.add(what);
  } else if (!bring(now, found->second)) {
    applied.erase(found);
  }
  is_visible_stale = true;
}

/// Replaces the old application by the new one; if only the robots' footprints changed, only the cells that
/// they cover. Returns false if nothing of the contribution remains.
bool OccupancyMap::Impl::bring(const std::optional<Applied>& now, Applied& old) {
  const bool same_rays = now && old.contribution == now->contribution && old.at == now->at &&
                         old.roles == now->roles && old.cuts == now->cuts;
  const bool same_robots = same_rays && old.robots == now->robots;
  const bool same_points = same_rays && old.voxels == now->voxels;
  if (same_robots && same_points) return true;
  if (!same_points) voxels.remove(old);
  if (!same_rays) {
    enter(old, -1);
    if (now) enter(*now, 1);
  } else if (!same_robots) {
    window.draw(*old.contribution, old.at, old.roles, old.cuts);
    coverBody(old);
    coverAll(old, RayWindow::kMaskA);
    coverAll(*now, RayWindow::kMaskB);
    cells.exchangeMasks(window, bucketOf(old), on_change);
  }
  if (!now) return false;
  old = *now;
  if (!same_points) voxels.add(old);
  return true;
}

/// Computes the visible cells again, if anything changed, and writes the changed ones into the octree.
const structure::SurfaceMap& OccupancyMap::Impl::freshVisible() {
  if (!is_visible_stale) return visible;
  is_visible_stale = false;
  structure::SurfaceMap now = visibleMap(cells, applied, options);
  std::vector<Eigen::Vector2d> robots_m;
  for (const auto& [key, what] : applied) robots_m.push_back(metres(scanOrigin(*what.contribution, what.at)));
  structure::hideBehindMirrors(now, robots_m,
                               options.default_radius_m + options.robot_margin_m + 2.0 * options.resolution_m,
                               options.mirrors);
  const auto cellOf = [&](const structure::SurfaceMap& map, std::size_t at) {
    return std::pair{
        std::llround(map.origin_m.x() / options.resolution_m) + static_cast<std::int64_t>(at) % map.width,
        std::llround(map.origin_m.y() / options.resolution_m) + static_cast<std::int64_t>(at) / map.width};
  };
  const auto classIn = [&](const structure::SurfaceMap& map, std::int64_t x, std::int64_t y) {
    if (map.width == 0) return structure::Cell::kUnknown;
    const auto [x_low, y_low] = cellOf(map, 0);
    const std::int64_t u = x - x_low, v = y - y_low;
    if (u < 0 || v < 0 || u >= map.width || v >= map.height) return structure::Cell::kUnknown;
    return map.cells[static_cast<std::size_t>(v * map.width + u)];
  };
  bool vanished = false;
  for (std::size_t at = 0; at < visible.cells.size() && !vanished; ++at) {
    if (visible.cells[at] == structure::Cell::kUnknown) continue;
    const auto [x, y] = cellOf(visible, at);
    vanished = classIn(now, x, y) == structure::Cell::kUnknown;
  }
  if (vanished) octree = LayerOctree(options.resolution_m);  // see LayerOctree::set()
  for (std::size_t at = 0; at < now.cells.size(); ++at) {
    if (now.cells[at] == structure::Cell::kUnknown) continue;
    const auto [x, y] = cellOf(now, at);
    if (vanished || classIn(visible, x, y) != now.cells[at])
      octree.set(x, y, now.cells[at] == structure::Cell::kOccupied ? CellClass::kOccupied : CellClass::kFree);
  }
  visible = std::move(now);
  return visible;
}

void OccupancyMap::Impl::refreshBetween(TimeNs first_ns, TimeNs last_ns) {
  for (const auto& [robot, path] : store.robots()) {
    for (auto it = path.lower_bound(first_ns); it != path.end() && it->first <= last_ns; ++it) {
      refresh(robot, it->first);
    }
  }
}

void OccupancyMap::Impl::refreshAll(const std::string& robot) {
  const auto* path = store.find(robot);
  if (path == nullptr) return;
  for (const auto& [time_ns, keyframe] : *path) refresh(robot, time_ns);
}

void OccupancyMap::Impl::coverAll(const Applied& what, std::uint8_t bit) {
  for (const auto& [robot, robot_pose] : what.robots) {
    const BodyMask& mask = maskOf(robot);
    window.cover(mask, robot_pose, marginOf(mask, robot_pose), bit);
  }
}

/// A robot drives on floor only. Nothing is claimed for a body that is not given.
void OccupancyMap::Impl::placeBody(Applied& what) const {
  const std::string& robot = what.contribution->robot;
  const auto found = footprints.find(robot);
  if (!options.driven_is_free || given_bodies.count(robot) == 0) return;
  what.body = &found->second;
  const auto half_cell = static_cast<std::int64_t>(std::ceil(0.5 * std::sqrt(2.0) * resolution_dmm));
  what.body_margin_dmm = -half_cell - sigmaMargin(found->second, what.at);
}

void OccupancyMap::Impl::coverBody(const Applied& what) {
  if (what.body != nullptr) window.cover(*what.body, what.at, what.body_margin_dmm, RayWindow::kDriven);
}

void OccupancyMap::Impl::enter(const Applied& what, int sign) {
  window.draw(*what.contribution, what.at, what.roles, what.cuts);
  coverBody(what);
  coverAll(what, RayWindow::kMaskA);
  cells.apply(window, bucketOf(what), sign, RayWindow::kMaskA, on_change);
}

OccupancyMap::OccupancyMap(const OccupancyOptions& options, const std::map<std::string, RobotBody>& bodies,
                           std::string frame)
    : impl_(std::make_unique<Impl>(options, bodies, std::move(frame))) {}
OccupancyMap::~OccupancyMap() = default;
OccupancyMap::OccupancyMap(OccupancyMap&&) noexcept = default;
OccupancyMap& OccupancyMap::operator=(OccupancyMap&&) noexcept = default;

bool OccupancyMap::add(const Contribution& contribution) {
  return impl_->add(contribution);
}
bool OccupancyMap::add(const KeyframePose& pose) {
  return impl_->add(pose);
}
void OccupancyMap::correctLater() {
  impl_->correct_later = true;
}
bool OccupancyMap::correctSome(std::size_t at_most) {
  return impl_->correct(at_most);
}
void OccupancyMap::overrideKinds(const std::map<std::pair<std::string, std::uint32_t>, ObjectKind>& kinds) {
  impl_->overrideKinds(kinds);
}
void OccupancyMap::setLenses(std::map<std::string, lens::Spread> lenses) {
  impl_->store.setLenses(std::move(lenses));
}

const ContributionStore& OccupancyMap::store() const {
  return impl_->store;
}
std::uint64_t OccupancyMap::classChanges() const {
  return impl_->class_changes;
}
const structure::SurfaceMap& OccupancyMap::visible() const {
  return impl_->freshVisible();
}
std::string OccupancyMap::octreeBytes(const std::vector<dataset::MapObject>& objects) const {
  const auto columns = columnsOf(objects, impl_->options.resolution_m);
  impl_->freshVisible();
  const LayerOctree& ground = impl_->octree;
  const auto points = impl_->voxels.occupied();
  return columns.empty() && points.empty() ? ground.bytes() : ground.with(columns, points).bytes();
}
std::array<std::uint8_t, 32> OccupancyMap::hash() const {
  const Sha256 cells = impl_->cells.hash();
  if (impl_->voxels.empty()) return cells;
  return sha256(std::string(cells.begin(), cells.end()) + impl_->voxels.canonicalBytes());
}

CellClass OccupancyMap::at(const Eigen::Vector2d& point_m) const {
  if (!point_m.allFinite() || point_m.cwiseAbs().maxCoeff() > 1e6) return CellClass::kUnknown;
  const Eigen::Vector2d cell = point_m / impl_->options.resolution_m;
  return impl_->cells.at(static_cast<std::int64_t>(std::floor(cell.x())),
                         static_cast<std::int64_t>(std::floor(cell.y())));
}

dataset::OccupancyGrid OccupancyMap::grid(const std::vector<dataset::MapObject>& objects) const {
  const structure::SurfaceMap& visible = impl_->freshVisible();
  dataset::OccupancyGrid grid;
  grid.resolution_m = impl_->options.resolution_m;
  grid.width = visible.width;
  grid.height = visible.height;
  grid.origin_m = visible.origin_m;
  grid.cells.reserve(visible.cells.size());
  for (const structure::Cell cell : visible.cells)
    grid.cells.push_back(cell == structure::Cell::kOccupied ? std::int8_t{100}
                         : cell == structure::Cell::kFree   ? std::int8_t{0}
                                                            : std::int8_t{-1});
  const std::int64_t x_low = std::llround(grid.origin_m.x() / grid.resolution_m),
                     y_low = std::llround(grid.origin_m.y() / grid.resolution_m);
  for (const LayerOctree::Column& column : columnsOf(objects, grid.resolution_m)) {
    const std::int64_t x = column.x - x_low, y = column.y - y_low;
    if (x < 0 || y < 0 || x >= grid.width || y >= grid.height) continue;
    grid.cells[static_cast<std::size_t>(y * grid.width + x)] = std::int8_t{100};
  }
  return grid;
}

std::string hexText(const std::array<std::uint8_t, 32>& bytes) {
  constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (const std::uint8_t byte : bytes) {
    text += kDigits[byte >> 4U];
    text += kDigits[byte & 15U];
  }
  return text;
}

}  // namespace omnifleet::occupancy
