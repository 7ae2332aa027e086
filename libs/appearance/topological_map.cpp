#include "appearance/topological_map.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "appearance/stored_signature.h"
#include "scan/keyframe_graph.h"

namespace omnifleet::appearance {
namespace {

constexpr double kOrigin_m = 1e-6, kOrigin_rad = 1e-6;  // σ of the first place: it defines the frame

Eigen::Matrix3d originCovariance() {
  return Eigen::Vector3d(kOrigin_m * kOrigin_m, kOrigin_m * kOrigin_m, kOrigin_rad * kOrigin_rad)
      .asDiagonal();
}

/// Covariance of the right perturbation of pose⁻¹ from that of the pose: Ad(pose) · covariance · Ad(pose)ᵀ.
Eigen::Matrix3d ofInverse(const Pose2& pose, const Eigen::Matrix3d& covariance) {
  Eigen::Matrix3d adjoint = Eigen::Matrix3d::Identity();
  adjoint.topLeftCorner<2, 2>() = pose.rotation();
  adjoint(0, 2) = pose.y_m;
  adjoint(1, 2) = -pose.x_m;
  return adjoint * covariance * adjoint.transpose();
}

bool isFinite(const Transition& t) {
  return std::isfinite(t.turn_rad) && std::isfinite(t.turn_sigma_rad) && std::isfinite(t.difference) &&
         t.difference >= 0.0 && std::isfinite(t.displacement_m.value_or(0.0)) &&
         std::isfinite(t.displacement_sigma_m) && std::isfinite(t.bearing_rad);
}

}  // namespace

TopologicalMapOptions TopologicalMapOptions::read(const options::Section& section) {
  TopologicalMapOptions o;
  section.read("use_wheels", o.use_wheels);
  section.read("midway", o.midway);
  section.read("difference_share", o.difference_share, {0.001, 10.0});
  section.read("least_sigma_m", o.least_sigma_m, {1e-6, 10.0});
  section.read("unknown_turn_rad", o.unknown_turn_rad, {0.001, 10.0});
  section.finish();
  return o;
}

TopologicalMap::TopologicalMap(std::string robot, std::string frame, const SignatureFormat& format,
                               const TopologicalMapOptions& options)
    : options_(options), robot_(std::move(robot)), frame_(std::move(frame)), format_(format) {}

std::uint32_t TopologicalMap::add(TimeNs acquired_ns, std::uint32_t sequence,
                                  const StoredSignature& signature,
                                  const std::optional<Transition>& transition) {
  if (const std::string reason = whyMalformed(format_, signature); !reason.empty())
    throw std::invalid_argument("topological map: " + reason);
  if (transition.has_value() == places_.empty())
    throw std::invalid_argument("topological map: every place but the first needs a transition");
  if (transition && !isFinite(*transition))
    throw std::invalid_argument(
        "topological map: the transition must consist of finite numbers, D of at least 0");
  Place place;
  place.robot = robot_;
  place.index = static_cast<std::uint32_t>(places_.size());
  place.acquired_ns = acquired_ns;
  place.sequence = sequence;
  place.frame = frame_;
  place.covariance = originCovariance();
  place.format = format_;
  place.signature = signature;
  places_.push_back(std::move(place));
  transitions_.push_back(transition.value_or(Transition{}));
  const MapScale before = scale_;
  if (transition) {
    relies_on_scale_ = relies_on_scale_ || !(options_.use_wheels && transition->displacement_m);
    learnScale(*transition);
  }
  const bool changed = relies_on_scale_ && (before.metric != scale_.metric || before.metres != scale_.metres);
  layOut(changed ? 1 : places_.size() - 1);
  return static_cast<std::uint32_t>(places_.size() - 1);
}

/// Least squares for length = scale · D. Its σ follows from the residuals.
void TopologicalMap::learnScale(const Transition& transition) {
  if (!transition.displacement_m || !(transition.difference > 0.0)) return;
  const double d = transition.difference, length = std::abs(*transition.displacement_m);
  sum_dd_ += d * d;
  sum_dl_ += d * length;
  sum_ll_ += length * length;
  ++measured_;
  scale_.metric = sum_dl_ > 0.0;
  if (!scale_.metric) return;
  scale_.metres = sum_dl_ / sum_dd_;
  const double residual = std::max(0.0, sum_ll_ - scale_.metres * sum_dl_);
  // A single link determines the scale, but not its σ.
  scale_.sigma_metres = measured_ > 1 ? std::sqrt(residual / (measured_ - 1) / sum_dd_)
                                      : options_.difference_share * scale_.metres;
}

/// Link to the place before, eq. 3–5.
PlaceLink TopologicalMap::linkOf(std::size_t index) const {
  const Transition& t = transitions_[index];
  const bool by_wheels = options_.use_wheels && t.displacement_m.has_value();
  const double length = by_wheels ? *t.displacement_m : scale_.metres * t.difference,
               direction = options_.midway ? 0.5 * t.turn_rad + t.bearing_rad : t.turn_rad,
               turn_sigma = t.turn_sigma_rad > 0.0 ? t.turn_sigma_rad : options_.unknown_turn_rad,
               along = std::max(by_wheels ? t.displacement_sigma_m : options_.difference_share * length,
                                options_.least_sigma_m),
               across = std::max(0.5 * std::abs(length) * turn_sigma, options_.least_sigma_m);
  PlaceLink link;
  link.robot = robot_;
  link.index = static_cast<std::uint32_t>(index - 1);
  const Pose2 other_from_this{length * std::cos(direction), length * std::sin(direction),
                              wrapAngle(t.turn_rad)};
  link.this_from_other = other_from_this.inverse();
  // σ along and across the link, in the axes of this place.
  const Eigen::Matrix2d axes = Eigen::Rotation2Dd(direction - t.turn_rad).toRotationMatrix();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  covariance.topLeftCorner<2, 2>() =
      axes * Eigen::Vector2d(along * along, across * across).asDiagonal() * axes.transpose();
  covariance(2, 2) = turn_sigma * turn_sigma;
  link.covariance = ofInverse(other_from_this, covariance);
  return link;
}

void TopologicalMap::layOut(std::size_t first) {
  for (Place& place : places_) place.metric = scale_.metric;
  for (std::size_t i = std::max<std::size_t>(first, 1); i < places_.size(); ++i) {
    Place& place = places_[i];
    const PlaceLink link = linkOf(i);
    const Pose2 before_from_this = link.this_from_other.inverse();
    place.frame_from_base = places_[i - 1].frame_from_base * before_from_this;
    place.covariance = composeCovariance(places_[i - 1].covariance, before_from_this,
                                         ofInverse(link.this_from_other, link.covariance));
    if (place.links.empty())
      place.links.push_back(link);
    else
      place.links.front() = link;
  }
}

void TopologicalMap::addLoop(std::uint32_t earlier, std::uint32_t later, const Pose2& earlier_from_later,
                             const Eigen::Matrix3d& covariance) {
  if (earlier >= later || later >= places_.size())
    throw std::invalid_argument(fmt::format("topological map: no loop from place {} to {}; it has {} places",
                                            later, earlier, places_.size()));
  if (!earlier_from_later.isFinite() || Eigen::LLT<Eigen::Matrix3d>(covariance).info() != Eigen::Success)
    throw std::invalid_argument(
        "topological map: a loop needs a finite pose and a positive definite covariance");
  PlaceLink link;
  link.closes_loop = true;
  link.robot = robot_;
  link.index = earlier;
  link.this_from_other = earlier_from_later.inverse();
  link.covariance = ofInverse(earlier_from_later, covariance);
  places_[later].links.push_back(link);
}

double TopologicalMap::optimise() {
  if (places_.size() < 2) return 0.0;
  scan::KeyframeGraph graph;
  for (const Place& place : places_) graph.add(place.frame_from_base);
  graph.addAbsolute(0, places_[0].frame_from_base, originCovariance());
  for (const Place& place : places_) {
    for (const PlaceLink& link : place.links)
      graph.addRelative(place.index, link.index, link.this_from_other, link.covariance);
  }
  graph.optimise();
  double largest = 0.0;
  for (Place& place : places_) {
    const Pose2& pose = graph.pose(place.index);
    largest = std::max(largest, (pose.translation() - place.frame_from_base.translation()).norm());
    place.frame_from_base = pose;
    place.covariance = graph.covariance(place.index);
  }
  return largest;
}

}  // namespace omnifleet::appearance
