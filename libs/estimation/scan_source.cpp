#include "estimation/scan_source.h"

#include <Eigen/Dense>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "estimation/boundary_correction.h"
#include "estimation/factors.h"
#include "estimation/fleet_state.h"
#include "estimation/troubles.h"

namespace omnifleet::estimation {
namespace {

constexpr double kBody_m = 0.05;         // margin around a robot's body
constexpr double kOutline_m = 0.05;      // margin around an object's outline
constexpr double kUnknown_m = 0.5;       // σ of a direction that a scan leaves open: no information
constexpr double kMoved_m = 0.0002;      // m, rad; a keyframe that moved less is where it was
constexpr double kSigmas = 3.0;          // of a prediction: its reach
constexpr double kTurnSigmas = 3.0;      // of the predicted heading: reach of a turn without wheels
constexpr int kRecently = 3;             // frames since landmarks or robots have confirmed the pose
constexpr int kRestarts = 3;             // of a match with few lines
constexpr double kExact = 1e-8;          // m², rad²; no odometry is better
constexpr double kOdometryScale = 0.02;  // σ of the scale of odometry between keyframes

double largestSigma(const Eigen::Matrix3d& information) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(information, Eigen::EigenvaluesOnly);
  return 1.0 / std::sqrt(std::max(solver.eigenvalues().minCoeff(), 1e-12));
}

/// Beams with a line that end at no free-standing object.
int linesOf(const scan::LineScan& scan, const std::vector<std::uint8_t>& on_object) {
  int lines = 0;
  for (std::size_t i = 0; i < scan.beams().size(); ++i)
    lines += scan.beams()[i].has_line && on_object[i] == 0 ? 1 : 0;
  return lines;
}

/// Quadratic cost around a match: directions without information are left out; the systematic error of a
/// match limits the others.
std::unique_ptr<ceres::CostFunction> scanFactor(const ScanLink& link, const Pose2& match,
                                                const Eigen::VectorXd& value) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(link.information);
  Eigen::Matrix3d to_body = Eigen::Matrix3d::Identity();
  to_body.topLeftCorner<2, 2>() = match.rotation().transpose();
  Eigen::MatrixXd s = Eigen::MatrixXd::Zero(3, 3);
  Eigen::VectorXd r0 = Eigen::VectorXd::Zero(3);
  for (Eigen::Index i = 0; i < 3; ++i) {
    const double lambda = solver.eigenvalues()(i);
    if (!(lambda > 1.0 / (kUnknown_m * kUnknown_m))) continue;
    const Eigen::Vector3d v = solver.eigenvectors().col(i);
    const double root = 1.0 / std::sqrt(1.0 / lambda + v.dot(link.systematic * v));
    s.row(i) = root * v.transpose() * to_body;
    r0(i) = -root * v.dot(link.gradient) / lambda;
  }
  Eigen::Vector3d at = match.vector();
  at.z() = value(2) + wrapAngle(match.theta_rad - value(2));
  return std::make_unique<DensePrior>(std::move(s), std::move(r0), std::vector<Eigen::VectorXd>{at});
}

}  // namespace

ScanSourceOptions ScanSourceOptions::read(const options::Section& section) {
  using options::kPositive;
  ScanSourceOptions o;
  section.read("use", o.use);
  section.read("front", o.front);
  section.read("min_matched", o.min_matched, {0.0, 1.0});
  section.read("max_chi2", o.max_chi2, kPositive);
  section.read("shift_m", o.shift_m, kPositive);
  section.read("shift_per_step", o.shift_per_step, options::kNotNegative);
  section.read("turn_rad", o.turn_rad, kPositive);
  section.read("turn_per_step", o.turn_per_step, options::kNotNegative);
  section.read("suffices_share", o.suffices_share, {0.0, 1.0});
  section.read("suffices_m", o.suffices_m, options::kNotNegative);
  section.read("suffices_rad", o.suffices_rad, options::kNotNegative);
  section.read("confirms_chi2", o.confirms_chi2, options::kNotNegative);
  section.read("nearly_all", o.nearly_all, {0.0, 1.0});
  section.read("wider", o.wider, {1.0, 100.0});
  section.read("missed_chi2", o.missed_chi2, options::kNotNegative);
  section.read("known", o.known, {0.0, 1.0});
  section.read("basin_m", o.basin_m, options::kNotNegative);
  section.read("basin_rad", o.basin_rad, options::kNotNegative);
  section.read("search_m", o.search_m, kPositive);
  section.read("laser_bearing_sigma_rad", o.laser_bearing_sigma_rad, options::kNotNegative);
  section.read("full_rank_m", o.full_rank_m, kPositive);
  section.finish();
  return o;
}

void ScanSource::forget(RobotNode& robot) {
  robot.scan_aid.anchor.reset();
  robot.scan_aid.way.reset();
  robot.scan_aid.references.clear();
  robot.scan_aid.matched = robot.scan_aid.suffices = robot.scan_aid.held = false;
}

/// Lines of the newest frame. Beams that end at other robots are left out.
void ScanSource::fit(const FleetState& fleet, RobotFrame& frame) {
  RobotNode& robot = *frame.robot;
  ScanAid& aid = robot.scan_aid;
  const Boundary& boundary = frame.objects->boundary;
  const std::size_t beams = boundary.inverse_m.size();
  aid.usable.assign(beams, true);
  aid.seen = boundary;
  aid.camera_height_m = frame.objects->camera_height_m;
  aid.on_object.assign(beams, 0);
  aid.base_from_scan = {boundary.origin_m.x(), boundary.origin_m.y(), 0.0};
  std::vector<std::pair<Eigen::Vector2d, double>> peers;
  const Pose2 base_from_map = fleet.pose(robot.window.back().pose).inverse();
  for (const RobotNode& other : fleet.robots) {
    const auto at = fleet.poseAt(other, frame.objects->acquired_ns);
    if (&other == &robot || !at) continue;
    const double sigma_m = std::sqrt(std::max(0.0, other.covariance.topLeftCorner<2, 2>().trace()));
    peers.emplace_back(base_from_map * at->map_from_base.translation(),
                       other.body->reach() + kBody_m + std::min(0.3, 3.0 * sigma_m));
  }
  for (std::size_t i = 0; i < beams; ++i) {
    if (!(boundary.sigma[i] > 0) || !(boundary.inverse_m[i] > 0)) continue;
    aid.usable[i] = boundary.moving.empty() || boundary.moving[i] == 0;
    if (peers.empty() && frame.objects->tracks.empty()) continue;
    const double bearing = 2.0 * M_PI * static_cast<double>(i) / static_cast<double>(beams);
    const Eigen::Vector2d end = boundary.origin_m + Eigen::Vector2d(std::cos(bearing), std::sin(bearing)) /
                                                        double(boundary.inverse_m[i]);
    for (const auto& [place, reach_m] : peers)
      aid.usable[i] = aid.usable[i] && (end - place).norm() > reach_m;
    for (const Seen& seen : frame.seen)
      if (seen.informative && distanceTo(seen.track->hull_m, end) < kOutline_m) aid.on_object[i] = 1;
  }
  correctBoundary(boundary, aid.assumed, aid.camera_height_m, robot.setup.lens, corrected_);
  const bool is_laser = !(aid.camera_height_m > 0);
  aid.scan.fit(corrected_, aid.usable, is_laser ? options_.laser_bearing_sigma_rad : 0.0);
  aid.has_scan = aid.scan.lines() >= static_cast<std::size_t>(fleet.keyframes.options().min_lines);
}

/// Turn since the frame before by the circular shift that makes both boundaries most alike.
std::optional<double> ScanSource::turnByShift(const Boundary& boundary, const ScanAid& aid,
                                              double reach_rad) const {
  constexpr float kAlike = 0.1f;  // relative difference of two inverse ranges that may be one surface
  const auto n = static_cast<int>(boundary.inverse_m.size());
  if (aid.previous_inverse.size() != boundary.inverse_m.size() || n == 0) return std::nullopt;
  const int reach = static_cast<int>(std::min(M_PI, reach_rad) * n / (2.0 * M_PI));
  double best = std::numeric_limits<double>::infinity();
  int best_shift = 0;
  for (int shift = -reach; shift <= reach; ++shift) {
    double sum = 0.0;
    int count = 0;
    for (int i = 0; i < n; i += 2) {
      const float a = boundary.inverse_m[static_cast<std::size_t>(i)],
                  b = aid.previous_inverse[static_cast<std::size_t>((i + shift + n) % n)];
      if (!(a > 0) || !(b > 0)) continue;
      sum += std::min(1.0f, std::abs(a - b) / (kAlike * std::max(a, b)));
      ++count;
    }
    if (count < n / 8) continue;
    if (sum / count < best) best = sum / count, best_shift = shift;
  }
  if (!std::isfinite(best)) return std::nullopt;
  return 2.0 * M_PI * best_shift / n;
}

/// Largest correction of a prediction: metres, radians.
Eigen::Vector2d ScanSource::gates(const Step& step, const Eigen::Matrix3d& covariance) const {
  const double sigma_m = std::sqrt(covariance.topLeftCorner<2, 2>().trace()),
               sigma_rad = std::sqrt(covariance(2, 2));
  const Pose2& way = step.previous_from_current;
  return {
      std::max(options_.shift_m + options_.shift_per_step * way.translation().norm(), kSigmas * sigma_m),
      std::max(options_.turn_rad + options_.turn_per_step * std::abs(way.theta_rad), kSigmas * sigma_rad)};
}

/// A match that confirms the prediction needs half the lines: both scans may be blocked by people.
bool ScanSource::accept(const scan::Match& match, const Pose2& predicted, const Eigen::Matrix3d& prior,
                        const Eigen::Vector2d& gates) const {
  if (!match.valid || match.chi2 > options_.max_chi2) return false;
  const Pose2 by = predicted.inverse() * match.map_from_scan;
  const bool confirms = by.vector().dot(prior * by.vector()) < options_.confirms_chi2;
  if (match.matched < (confirms ? 0.5 : 1.0) * options_.min_matched) return false;
  const double wider = match.matched < options_.nearly_all ? 1.0 : options_.wider;
  return by.translation().norm() < wider * gates.x() && std::abs(by.theta_rad) < wider * gates.y();
}

/// Whether a match that was found as if nothing had measured the step shows that the robot has not moved as
/// measured: nearly all lines meet, in every direction, and beyond what the prediction allows.
/// @param covariance of `predicted` @param gates as if nothing had measured the step
bool ScanSource::refutesStep(const scan::Match& match, const Pose2& predicted,
                             const Eigen::Matrix3d& covariance, const Eigen::Vector2d& gates,
                             double gate_chi2) const {
  if (!match.valid || match.chi2 > options_.max_chi2 || match.matched < options_.nearly_all) return false;
  if (!(largestSigma(match.information) < options_.full_rank_m)) return false;
  const Pose2 by = predicted.inverse() * match.map_from_scan;
  return by.translation().norm() < gates.x() && std::abs(by.theta_rad) < gates.y() &&
         by.vector().dot(covariance.ldlt().solve(by.vector())) > gate_chi2;
}

/// Whether the scan alone puts the robot elsewhere than absolute measurements do.
/// @param prior covariance of `predicted`, which rests on these measurements
bool ScanSource::contradicts(const scan::Match& match, const Pose2& predicted,
                             const Eigen::Matrix3d& prior) const {
  constexpr double kChi2 = 16.3;  // 3 dof, 99.9 %
  const Eigen::Matrix3d loose = Eigen::Matrix3d::Identity() / (kUnknown_m * kUnknown_m);
  const Eigen::Matrix3d by_scan = (match.information + loose).inverse();
  const Eigen::Vector3d off = (predicted.inverse() * match.map_from_scan).vector() + by_scan * match.gradient;
  const Eigen::Matrix3d covariance = prior + by_scan;
  return off.dot(covariance.ldlt().solve(off)) > kChi2;
}

/// The way of the wheels alone since the last keyframe.
void ScanSource::followOdometry(ScanAid& aid, const Step& step) {
  if (!aid.way) return;
  if (!step.hasOdometry()) {
    aid.way.reset();
    return;
  }
  aid.way->covariance =
      composeCovariance(aid.way->covariance, step.previous_from_current, step.wheel_covariance);
  aid.way->previous_from_this = aid.way->previous_from_this * step.previous_from_current;
}

void ScanSource::observe(FleetState& fleet, RobotFrame& frame) {
  RobotNode& robot = *frame.robot;
  ScanAid& aid = robot.scan_aid;
  aid.matched = aid.contradicted = aid.suffices = aid.has_scan = aid.rich = false;
  if (!options_.use || !robot.setup.match_scans || !frame.isPlaced()) return;
  const Step& step = robot.window.back();
  if (step.motion != kNoFactor) followOdometry(aid, step);
  if (aid.anchor && step.motion != kNoFactor) {
    aid.anchor->keyframe_from_base = aid.anchor->keyframe_from_base * step.previous_from_current;
    aid.anchor->covariance =
        composeCovariance(aid.anchor->covariance, step.previous_from_current, step.motion_covariance);
  }
  const Boundary& boundary = frame.objects->boundary;
  if (!frame.sees() || boundary.inverse_m.empty()) {
    aid.previous_inverse.clear();
    return;
  }
  fit(fleet, frame);
  if (aid.has_scan) match(fleet, frame, boundary);
  aid.previous_inverse = boundary.inverse_m;
}

void ScanSource::match(FleetState& fleet, RobotFrame& frame, const Boundary& boundary) {
  RobotNode& robot = *frame.robot;
  ScanAid& aid = robot.scan_aid;
  const Step& step = robot.window.back();
  const KeyframeMap& map = fleet.keyframes;
  const Eigen::Matrix3d j = scanByBase(aid.base_from_scan);
  // Evidence counts once: what stands free belongs to the landmarks where the rest of the scan is not enough.
  const Eigen::Matrix3d rest = j.transpose() * aid.scan.information(aid.on_object) * j / aid.scatter;
  const Eigen::Matrix3d rest_covariance = (rest + 1e-6 * Eigen::Matrix3d::Identity()).inverse();
  const int rest_lines = linesOf(aid.scan, aid.on_object);
  aid.rich = rest_lines >= options_.suffices_share * static_cast<double>(aid.scan.beams().size()) &&
             rest_covariance.topLeftCorner<2, 2>().trace() < options_.suffices_m * options_.suffices_m &&
             rest_covariance(2, 2) < options_.suffices_rad * options_.suffices_rad;
  // What stands free in a laser's scan belongs to its scan: its outlines are no more accurate.
  const bool is_laser = !(aid.camera_height_m > 0);
  aid.rich = aid.rich || is_laser;
  const bool suffices = aid.rich;
  Pose2 predicted = fleet.pose(step.pose);
  const Eigen::Matrix3d& known =
      robot.absolute_aid.fix ? robot.absolute_aid.fix->covariance : robot.covariance;
  const double variance_m2 = 0.5 * aid.relative_covariance.topLeftCorner<2, 2>().trace();
  aid.references =
      aid.anchor && !robot.absolute_aid.fix
          ? map.references(aid.anchor->keyframe, variance_m2, {predicted, aid.scan.sectors()})
          : map.references(0.5 * known.topLeftCorner<2, 2>().trace(), {predicted, aid.scan.sectors()});
  if (aid.references.empty()) return;
  references_.clear();
  for (const KeyframeMap::Id k : aid.references) references_.push_back(map.reference(k));
  const double distance_m = (map.pose(aid.references.front()).translation() - predicted.translation()).norm();
  const KeyframeMap::Id nearest = aid.references.front();
  const Eigen::Matrix3d covariance =
      (robot.absolute_aid.fix ? Eigen::Matrix3d(robot.absolute_aid.fix->covariance + map.covariance(nearest))
       : aid.anchor           ? aid.relative_covariance
                              : robot.covariance) +
      map.systematic(nearest, distance_m);
  static const std::vector<std::uint8_t> kAll;
  const std::vector<std::uint8_t>& skip = suffices || !fleet.options.use_landmarks ? kAll : aid.on_object;
  // Few surfaces are visible: landmarks are more accurate, where there are any.
  if (!suffices && fleet.options.use_landmarks &&
      (robot.track_aid.unobserved <= kRecently || rest_lines < map.options().min_lines))
    return;
  const Eigen::Vector2d gates = this->gates(step, covariance);
  const Pose2 scan_predicted = predicted * aid.base_from_scan;
  scan::Match found = align(aid, step, boundary, scan_predicted, covariance, skip);
  bool accepted =
      accept(found, scan_predicted, (j * covariance * j.transpose()).inverse(), gates) &&
      !(robot.absolute_aid.fix && contradicts(found, scan_predicted, j * covariance * j.transpose()));
  const bool few = !accepted || found.matched < options_.min_matched;
  if (few && step.isMeasured() && step.motion != kNoFactor && !robot.absolute_aid.fix) {
    const Eigen::Matrix3d unknown =
        fleet.unknownMotion(static_cast<double>(step.time_ns - step.since_ns) * 1e-9);
    const scan::Match other = align(aid, step, boundary, scan_predicted, covariance + unknown, skip);
    if (refutesStep(other, scan_predicted, j * covariance * j.transpose(),
                    this->gates(step, covariance + unknown), fleet.options.gate_chi2)) {
      found = other;
      accepted = true;
      fleet.loosen(robot, step.motion_covariance + unknown);
      aid.way.reset();
      rejectStep(frame);
    }
  }
  aid.contradicted = !accepted && search_.evaluate(aid.scan, scan_predicted).known > options_.known;
  if (!accepted) return;
  aid.matched = true;
  aid.suffices = suffices;
  aid.scatter = found.scatter;
  link(fleet, robot, found);
}

/// Matches a scan with `references_` from the predicted pose, and from others where it may lie elsewhere.
scan::Match ScanSource::align(const ScanAid& aid, const Step& step, const Boundary& boundary,
                              const Pose2& predicted, const Eigen::Matrix3d& covariance,
                              const std::vector<std::uint8_t>& skip) {
  const Eigen::Matrix3d j = scanByBase(aid.base_from_scan);
  const Eigen::Matrix3d prior = (j * covariance * j.transpose()).inverse();
  // χ² of the prediction's correction, and of the lines that meet none: each is as bad as one at the gate.
  const auto cost = [&](const scan::Match& m) {
    const Eigen::Vector3d by = (predicted.inverse() * m.map_from_scan).vector();
    return options_.missed_chi2 * m.beams * (1.0 / m.matched - 1.0) + by.dot(prior * by);
  };
  const auto better = [&](const scan::Match& a, const scan::Match& b) {
    return a.valid && (!b.valid || cost(a) < cost(b));
  };
  scan::Match found = matcher_.match(aid.scan, predicted, prior, references_, skip);
  const auto tryFrom = [&](const Pose2& start) {
    const scan::Match other = matcher_.match(aid.scan, start, prior, references_, skip);
    if (better(other, found)) found = other;
  };
  if (!step.isMeasured()) {
    // Constant velocity says little about a turn.
    if (const auto turn = turnByShift(boundary, aid, kTurnSigmas * std::sqrt(covariance(2, 2)))) {
      const double heading = wrapAngle(predicted.theta_rad - step.previous_from_current.theta_rad + *turn);
      const Eigen::Vector2d before = (predicted * step.previous_from_current.inverse()).translation();
      tryFrom({predicted.x_m, predicted.y_m, heading});
      tryFrom({before.x(), before.y(), heading});
    }
  }
  // A start beside the optimum pairs some lines wrongly. From where it has led the rest are found.
  for (int i = 0; i < kRestarts && found.valid && found.matched < options_.nearly_all; ++i) {
    const double before = found.matched;
    tryFrom(found.map_from_scan);
    if (found.matched <= before) break;
  }
  // Where the pose may lie beyond the reach of such a start, all of it is searched.
  const Eigen::Vector2d gates = this->gates(step, covariance);
  const bool is_far = kSigmas * std::sqrt(covariance.topLeftCorner<2, 2>().trace()) > options_.basin_m ||
                      kSigmas * std::sqrt(covariance(2, 2)) > options_.basin_rad;
  if (accept(found, predicted, prior, gates) && !(is_far && found.matched < options_.nearly_all))
    return found;
  search_.setReferences(references_);
  for (const scan::PlaceCandidate& candidate :
       search_.search(aid.scan, predicted, std::min(options_.wider * gates.x(), options_.search_m),
                      options_.wider * gates.y()))
    tryFrom(candidate.map_from_scan);
  return found;
}

void ScanSource::link(FleetState& fleet, RobotNode& robot, const scan::Match& match) {
  ScanAid& aid = robot.scan_aid;
  Step& step = robot.window.back();
  const Eigen::Matrix3d j = scanByBase(aid.base_from_scan);
  const Pose2 map_from_base = match.map_from_scan * aid.base_from_scan.inverse();
  const KeyframeMap& map = fleet.keyframes;
  ScanLink link;
  link.keyframe = aid.references.front();
  link.map_from_keyframe = map.pose(link.keyframe);
  link.keyframe_from_base = map.pose(link.keyframe).inverse() * map_from_base;
  link.information = j.transpose() * match.information * j;
  link.gradient = j.transpose() * match.gradient;
  link.systematic = map.systematic(link.keyframe, link.keyframe_from_base.translation().norm());
  const Pose2 by = fleet.pose(step.pose).inverse() * map_from_base;
  Eigen::VectorXd& value = fleet.graph.value(step.pose);
  link.factor = fleet.graph.addFactor(scanFactor(link, map_from_base, value), {step.pose});
  value.head<2>() = map_from_base.translation();
  value(2) += wrapAngle(map_from_base.theta_rad - value(2));
  const bool full_rank = largestSigma(link.information) < options_.full_rank_m;
  const Eigen::Matrix3d loose = Eigen::Matrix3d::Identity() / (kUnknown_m * kUnknown_m);
  if (step.wheels && !step.wheels_rejected && !step.by_floor && !step.rejected)
    aid.odometry.add(by, (link.information + loose).inverse() + link.systematic, step.claimed_covariance,
                     step.previous_from_current.translation().norm());
  else
    aid.odometry.interrupt();
  if (full_rank) {
    const Eigen::Matrix3d covariance = link.information.inverse() + link.systematic;
    aid.anchor =
        ScanAid::Anchor{link.keyframe, map.pose(link.keyframe), link.keyframe_from_base, covariance, true};
  } else if (aid.anchor) {
    // The directions that the scan leaves open stay with the odometry.
    aid.anchor->keyframe_from_base = map.pose(aid.anchor->keyframe).inverse() * map_from_base;
    aid.anchor->covariance =
        (aid.anchor->covariance.inverse() + link.information).inverse() + link.systematic;
    aid.anchor->by_match = true;
  }
  aid.held = true;
  step.scan = std::move(link);
}

void ScanSource::keep(FleetState& fleet) {
  if (!options_.use) return;
  KeyframeMap& map = fleet.keyframes;
  for (RobotNode& robot : fleet.robots) {
    ScanAid& aid = robot.scan_aid;
    if (!robot.located() || !robot.unrefined || !aid.has_scan || aid.contradicted) continue;
    if (robot.localization_aid.monitor.isInDoubt()) continue;  // a wrong place must not enter the map
    // Where nothing of a scan matches, only odometry says where it belongs, once matches have confirmed
    // it.
    const Step& step = robot.window.back();
    const bool by_odometry = step.hasOdometry() && robot.odometryOf(step).isConfirmed();
    if (aid.held && !aid.matched && !by_odometry) continue;
    const Pose2 map_from_base = fleet.pose(robot.window.back().pose);
    if (!map.wants({map_from_base, aid.scan.sectors()}, aid.references, aid.scan)) continue;
    KeyframeMap::Held held;
    held.covariance = robot.covariance;
    std::vector<KeyframeMap::Id> known = aid.references;
    held.odometry = aid.way;
    if (step.hasOdometry())
      map.setJitter(static_cast<std::uint32_t>(&robot - fleet.robots.data()),
                    robot.odometryOf(step).jitter());
    if (aid.anchor && !robot.absolute_aid.fix) {
      if (aid.anchor->by_match || !aid.way) held.previous = aid.anchor->keyframe;
      held.previous_from_this = aid.anchor->keyframe_from_base;
      held.covariance = aid.anchor->covariance;
      const double scale = aid.anchor->by_match ? 0.0 : kOdometryScale;
      const double way_m = scale * held.previous_from_this.translation().norm(),
                   turn_rad = scale * std::abs(held.previous_from_this.theta_rad);
      held.covariance.diagonal() +=
          Eigen::Vector3d(way_m * way_m + kExact, way_m * way_m + kExact, turn_rad * turn_rad + kExact);
      known =
          map.references(aid.anchor->keyframe, 0.5 * aid.relative_covariance.topLeftCorner<2, 2>().trace(),
                         {map_from_base, aid.scan.sectors()}, map.options().pairs);
    }
    KeyframeMap::Source source{static_cast<std::uint32_t>(&robot - fleet.robots.data()),
                               aid.seen,
                               aid.usable,
                               aid.base_from_scan,
                               aid.camera_height_m,
                               robot.setup.lens,
                               aid.assumed,
                               aid.rich};
    const KeyframeMap::Id id = map.add(map_from_base, std::move(source), aid.scan, held, known);
    aid.anchor = ScanAid::Anchor{id, map_from_base, Pose2{}, Eigen::Matrix3d::Zero()};
    aid.way = KeyframeMap::Odometry{id, Pose2{}, kExact * Eigen::Matrix3d::Identity()};
  }
  if (fleet.options.camera.estimate) {
    weighCameras(fleet);
    assumeCameras(fleet);
  }
  for (RobotNode& robot : fleet.robots) followKeyframes(fleet, robot);
}

/// Scans are corrected for the errors of their cameras as they are published, and anew when that changes by
/// more than a match is exact to.
void ScanSource::assumeCameras(FleetState& fleet) {
  constexpr double kNoticeable = 0.002;  // camera heights, at three heights away: about 1 mm at 1.5 m
  for (RobotNode& robot : fleet.robots) {
    if (robot.camera_aid.error == 0 || robot.scan_aid.camera_height_m <= 0) continue;
    const Eigen::Vector4d& now = robot.camera_aid.published;
    if (displacement(now - robot.scan_aid.assumed, robot.setup.lens) < kNoticeable) continue;
    robot.scan_aid.assumed = now;
    fleet.keyframes.assume(static_cast<std::uint32_t>(&robot - fleet.robots.data()), now);
  }
}

/// One factor on the errors of all cameras that have keyframes, in place of the one before.
void ScanSource::weighCameras(FleetState& fleet) {
  if (fleet.keyframes.size() == weighed_) return;
  weighed_ = fleet.keyframes.size();
  const scan::CameraEvidence evidence = fleet.keyframes.cameraEvidence();
  if (evidence.at.size() == 0) return;
  std::vector<VariableId> variables;
  std::vector<Eigen::VectorXd> at;
  std::vector<Eigen::Index> rows;
  for (Eigen::Index k = 0; 4 * k < evidence.at.size(); ++k) {
    RobotNode& robot = fleet.robots[static_cast<std::size_t>(k)];
    if (robot.scan_aid.camera_height_m <= 0) continue;
    variables.push_back(fleet.camera(robot));
    CameraError error = fleet.cameraError(robot);
    error.head<4>() = evidence.at.segment<4>(4 * k);
    at.emplace_back(error);
    rows.push_back(4 * k);
  }
  if (rows.empty()) return;  // lasers
  const auto cameras = static_cast<Eigen::Index>(rows.size());
  Eigen::MatrixXd information(4 * cameras, 4 * cameras);
  Eigen::VectorXd gradient(4 * cameras);
  for (Eigen::Index i = 0; i < cameras; ++i) {
    gradient.segment<4>(4 * i) = evidence.gradient.segment<4>(rows[static_cast<std::size_t>(i)]);
    for (Eigen::Index k = 0; k < cameras; ++k)
      information.block<4, 4>(4 * i, 4 * k) = evidence.information.block<4, 4>(
          rows[static_cast<std::size_t>(i)], rows[static_cast<std::size_t>(k)]);
  }
  // A height error scales a whole scan, so scans alone do not determine it.
  for (Eigen::Index i = CameraOptions::kHeight; i < 4 * cameras; i += 4) {
    information.row(i).setZero();
    information.col(i).setZero();
    gradient(i) = 0.0;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(information);
  Eigen::MatrixXd s = Eigen::MatrixXd::Zero(4 * cameras, kCameraErrors * cameras);
  Eigen::VectorXd r0 = Eigen::VectorXd::Zero(4 * cameras);
  for (Eigen::Index i = 0; i < 4 * cameras; ++i) {
    const double lambda = solver.eigenvalues()(i);
    if (!(lambda > 1.0)) continue;  // σ of 1: far above every prior
    const Eigen::VectorXd v = solver.eigenvectors().col(i);
    for (Eigen::Index k = 0; k < cameras; ++k)
      s.block<1, 4>(i, kCameraErrors * k) = std::sqrt(lambda) * v.segment<4>(4 * k).transpose();
    r0(i) = -v.dot(gradient) / std::sqrt(lambda);
  }
  if (camera_factor_ != kNoFactor) fleet.graph.removeFactor(camera_factor_);
  camera_factor_ = fleet.graph.addFactor(
      std::make_unique<DensePrior>(std::move(s), std::move(r0), std::move(at)), variables);
}

/// Takes the window along when keyframes have moved: its poses as a whole, its matches one by one.
void ScanSource::followKeyframes(FleetState& fleet, RobotNode& robot) {
  const KeyframeMap& map = fleet.keyframes;
  std::optional<ScanAid::Anchor>& anchor = robot.scan_aid.anchor;
  if (!robot.located() || !anchor) return;
  const Pose2 moved = map.pose(anchor->keyframe) * anchor->map_from_keyframe.inverse();
  anchor->map_from_keyframe = map.pose(anchor->keyframe);
  if (!robot.scan_aid.held) return;
  for (Step& step : robot.window) {
    Eigen::VectorXd& value = fleet.graph.value(step.pose);
    const Eigen::Vector2d place = moved * Eigen::Vector2d(value.head<2>());
    value.head<2>() = place;
    value(2) += moved.theta_rad;
    if (step.scan.factor == kNoFactor) continue;
    const Pose2 keyframe = map.pose(step.scan.keyframe),
                by = step.scan.map_from_keyframe.inverse() * keyframe;
    if (by.translation().norm() < kMoved_m && std::abs(by.theta_rad) < kMoved_m) continue;
    fleet.graph.removeFactor(step.scan.factor);
    step.scan.map_from_keyframe = keyframe;
    step.scan.factor = fleet.graph.addFactor(
        scanFactor(step.scan, keyframe * step.scan.keyframe_from_base, value), {step.pose});
  }
}

Eigen::Matrix3d ScanSource::inMap(const FleetState& fleet, const RobotNode& robot) {
  const ScanAid& aid = robot.scan_aid;
  const bool in_window = std::any_of(robot.window.begin(), robot.window.end(),
                                     [](const Step& step) { return step.scan.factor != kNoFactor; });
  const bool by_landmarks = robot.track_aid.unobserved == 0 && !in_window;
  if (!aid.anchor || by_landmarks || !aid.held) return aid.relative_covariance;
  const KeyframeMap& map = fleet.keyframes;
  const Pose2 way = map.pose(aid.anchor->keyframe).inverse() * fleet.pose(robot.window.back().pose);
  return composeCovariance(
      map.covariance(aid.anchor->keyframe), way,
      aid.relative_covariance + map.systematic(aid.anchor->keyframe, way.translation().norm()));
}

}  // namespace omnifleet::estimation
