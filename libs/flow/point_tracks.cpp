#include "flow/point_tracks.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::flow {

PointOptions PointOptions::read(const options::Section& section) {
  PointOptions o;
  section.read("max_sigma_m", o.max_sigma_m, {0.001, 10.0});
  section.read("min_parallax_deg", o.min_parallax_deg, {0.1, 90.0});
  section.read("gate_px", o.gate_px, {0.1, 20.0});
  section.read("sigmas", o.sigmas, {0.5, 100.0});
  section.read("drift_px", o.drift_px, {0.0, 5.0});
  section.read("baseline_sigma", o.baseline_sigma, {0.0, 0.5});
  section.read("turn_sigma_radpm", o.turn_sigma_radpm, {0.0, 10.0});
  section.read("max_frames", o.max_frames, {2, 10000});
  section.finish();
  return o;
}

PointTracks::PointTracks(const lens::Camera& camera, const PointOptions& options, double sigma_px)
    : camera_(&camera), options_(options), sigma_px_(sigma_px) {
  const double sigma = options.turn_sigma_radpm;
  turn_covariance_ = sigma * sigma * Eigen::Matrix2d::Identity();
}

void PointTracks::forget() {
  last_pixels_.clear();
  next_pixels_.clear();
  last_.clear();
  next_.clear();
  places_[0] = places_[1] = Place{};
  is_placed_ = false;
}

void PointTracks::advance(const Motion& motion) {
  if (!motion.valid) return forget();
  std::swap(last_pixels_, next_pixels_);
  std::swap(last_, next_);
  next_pixels_.clear();
  next_.clear();
  places_[0] = places_[1];
  const Eigen::Vector2d rolled(motion.left_m, motion.right_m);
  const double turn = rolled.dot(turn_radpm_), half = 0.5 * turn;
  const Pose2& measured = motion.previous_from_current;
  const Pose2 step{measured.x_m - half * measured.y_m, measured.y_m + half * measured.x_m,
                   measured.theta_rad + turn};
  places_[1].odom_from_base = places_[0].odom_from_base * step;
  places_[1].variance_m2 += 0.5 * motion.covariance.topLeftCorner<2, 2>().trace();
  places_[1].variance_rad2 += motion.covariance(2, 2);
  places_[1].rolled_m += rolled;
  turn_sigma_rad_ = std::sqrt(motion.covariance(2, 2) + rolled.dot(turn_covariance_ * rolled));
  is_placed_ = true;
}

bool PointTracks::sightOf(const Eigen::Vector2f& pixel, const Place& place, Sight& sight) const {
  const auto ray = camera_->rayFromPixel(pixel.cast<double>());
  if (!ray) return false;
  // Angle of a pixel: the larger one of the radial and the tangential direction.
  const Eigen::Vector2d outward = pixel.cast<double>() - camera_->model().principal_point_px;
  const double r = outward.norm();
  const Eigen::Vector2d along = r > 1e-6 ? Eigen::Vector2d(outward / r) : Eigen::Vector2d::UnitX();
  sight.rad_per_px = 0.0;
  for (const Eigen::Vector2d& step : {along, Eigen::Vector2d(-along.y(), along.x())}) {
    const auto beside = camera_->rayFromPixel(pixel.cast<double>() -
                                              step);  // inward, because that side is inside the field of view
    if (beside) sight.rad_per_px = std::max(sight.rad_per_px, (*beside - *ray).norm());
  }
  sight.in_base = *ray;
  sight.place(place, *camera_);
  return sight.rad_per_px > 0.0;
}

void PointTracks::Sight::place(const Place& place, const lens::Camera& camera) {
  from_m << place.odom_from_base * camera.foot(), camera.height();
  direction << place.odom_from_base.rotation() * in_base.head<2>(), in_base.z();
  from = place;
}

bool PointTracks::find(const Eigen::Vector2f& from_px, Eigen::Vector2f& last_px, Track& track) {
  auto nearest = static_cast<float>(options_.gate_px * options_.gate_px);
  std::size_t found = last_.size();
  for (std::size_t i = 0; i < last_.size(); ++i) {
    const float apart = (last_pixels_[i] - from_px).squaredNorm();
    if (apart >= nearest) continue;
    nearest = apart;
    found = i;
  }
  if (found == last_.size() || last_[found].frames == 0 || last_[found].frames >= options_.max_frames)
    return false;
  last_px = last_pixels_[found];
  track = last_[found];
  return true;
}

void PointTracks::follow(const Eigen::Vector2f& from_px, const Eigen::Vector2f& to_px) {
  Track track;
  Eigen::Vector2f last_px = from_px;
  if (is_placed_ && !find(from_px, last_px, track) && sightOf(from_px, places_[0], track.first))
    track.frames = 1;
  // The corner was detected again. The feature continues from its last position by the displacement of the
  // corner.
  const Eigen::Vector2f pixel = to_px + last_px - from_px;
  if (track.frames > 0) track.frames = sightOf(pixel, places_[1], track.now) ? track.frames + 1 : 0;
  next_pixels_.push_back(pixel);
  next_.push_back(track);
}

const std::vector<ScenePoint>& PointTracks::points() {
  learnTurn();
  points_.clear();
  for (const Track& track : next_) {
    points_.push_back(track.frames > 0 ? meet(track) : ScenePoint{});
  }
  return points_;
}

/// σ (rad) of the angle between both lines of sight, seen from the first position.
double PointTracks::noiseOf(const Track& track, double range_ratio) const {
  const double first = sigma_px_ * track.first.rad_per_px;
  const double now = sigma_px_ * track.now.rad_per_px * range_ratio;
  const double drift =
      options_.drift_px * track.now.rad_per_px * std::sqrt(static_cast<double>(track.frames - 1));
  return std::sqrt(first * first + now * now + drift * drift);
}

/// A point of a static object shows at least the parallax of the floor in the same direction.
bool PointTracks::isAboveFloor(const Track& track, double across_m) const {
  const Sight &first = track.first, &now = track.now;
  const Eigen::Vector3d turned = now.direction - first.direction * first.direction.dot(now.direction);
  const Eigen::Vector3d baseline = now.from_m - first.from_m;
  const double approach = -turned.dot(baseline);
  const double inverse_range = approach > 0.0 ? turned.squaredNorm() / approach : 0.0;
  const double of_floor = std::max(0.0, -now.direction.z() / camera_->height());
  const double sigma = std::hypot(noiseOf(track, 1.0), turn_sigma_rad_) / across_m;
  return inverse_range > of_floor - options_.sigmas * sigma;
}

/// Estimates from the features by how much the measured turn of the last step is wrong.
void PointTracks::learnTurn() {
  if (!is_placed_) return;
  const Eigen::Vector2d rolled = places_[1].rolled_m - places_[0].rolled_m;
  constexpr double kStanding_m = 0.005;
  if (rolled.cwiseAbs().maxCoeff() < kStanding_m) return;
  findConstraints();
  double sum = 0.0, information = 0.0;
  const double prior = 1.0 / (turn_sigma_rad_ * turn_sigma_rad_ + 1e-12);
  for (int i = 0; i < 6; ++i) {
    const double turn = sum / (information + prior);
    sum = information = 0.0;
    for (const Constraint& c : constraints_) {
      const double off = (c.missed + turn * c.per_rad) / (2.0 * c.sigma);
      const double weight = 1.0 / (c.sigma * c.sigma * (1.0 + off * off));  // Cauchy weight
      information += weight * c.per_rad * c.per_rad;
      sum -= weight * c.per_rad * c.missed;
    }
  }
  if (!(information > 0.0)) return;
  constexpr double kCorrelated = 4.0;  // errors of features on one object are correlated
  const double white = places_[1].variance_rad2 - places_[0].variance_rad2 + kCorrelated / information;
  const Eigen::Vector2d gain = turn_covariance_ * rolled;
  const double variance = rolled.dot(gain) + white, missed = sum / information;
  if (missed * missed > options_.sigmas * options_.sigmas * variance) return;
  turn_radpm_ += gain * (missed / variance);
  turn_covariance_ -= gain * gain.transpose() / variance;
}

void PointTracks::findConstraints() {
  const Pose2& now = places_[1].odom_from_base;
  const Eigen::Vector2d step = now.translation() - places_[0].odom_from_base.translation();
  const Eigen::Vector2d arm = now.rotation() * camera_->foot();
  // Derivative by the turn: the camera rotates about the axle, and the step rotates by half the turn.
  const Eigen::Vector3d shift(-arm.y() - 0.5 * step.y(), arm.x() + 0.5 * step.x(), 0.0);
  constraints_.clear();
  for (const Track& track : next_) {
    if (track.frames == 0) continue;
    const Sight &a = track.first, &b = track.now;
    const Eigen::Vector3d normal = (b.from_m - a.from_m).cross(a.direction);
    const double length = normal.norm();
    constexpr double kShortest_m = 0.005;  // minimum baseline across the line of sight
    if (length < kShortest_m || !isAboveFloor(track, length)) continue;
    const Eigen::Vector3d turning(-b.direction.y(), b.direction.x(), 0.0);
    constraints_.push_back({normal.dot(b.direction) / length,
                            (normal.dot(turning) + shift.cross(a.direction).dot(b.direction)) / length,
                            noiseOf(track, 1.0)});
  }
}

ScenePoint PointTracks::meet(const Track& track) const {
  const Sight &first = track.first, &now = track.now;
  const auto across = [&](const Eigen::Vector3d& v) -> Eigen::Vector3d {
    return v - first.direction * first.direction.dot(v);
  };
  const Eigen::Vector3d baseline = now.from_m - first.from_m;
  const Eigen::Vector3d turned = across(now.direction), moved = across(baseline);
  const double sine = turned.norm();
  if (sine < std::sin(options_.min_parallax_deg * M_PI / 180.0)) return {};
  const double range = -turned.dot(moved) / (sine * sine);
  const double first_range = first.direction.dot(baseline + range * now.direction);
  if (!(range > 0.0) || !(first_range > 0.0)) return {};
  // All quantities as angles seen from the first position.
  const double pixels = noiseOf(track, range / first_range);
  const double way2 = (now.from.variance_m2 - first.from.variance_m2) / (first_range * first_range);
  const Eigen::Vector2d rolled = now.from.rolled_m - first.from.rolled_m;
  const double turn2 =
      now.from.variance_rad2 - first.from.variance_rad2 + rolled.dot(turn_covariance_ * rolled);
  const double sigma_rad = std::sqrt(pixels * pixels + way2 + turn2);
  const double missed = (moved + range * turned).norm() / first_range;
  if (missed > options_.sigmas * sigma_rad) return {};
  const double sigma_m = std::hypot(first_range * sigma_rad / sine, range * options_.baseline_sigma);
  if (sigma_m > options_.max_sigma_m) return {};
  const Eigen::Vector3d in_odom = now.from_m + range * now.direction;
  if (in_odom.z() < -options_.sigmas * sigma_m * std::abs(now.direction.z())) return {};  // below the floor
  ScenePoint point;
  const Eigen::Vector2d in_base = places_[1].odom_from_base.inverse() * in_odom.head<2>();
  point.point_m << in_base.cast<float>(), static_cast<float>(in_odom.z());
  point.sigma_m = static_cast<float>(sigma_m);
  return point;
}

}  // namespace omnifleet::flow
