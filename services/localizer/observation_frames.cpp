#include "localizer/observation_frames.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace omnifleet::localizer {
namespace {

constexpr int kRays = 360, kVertices = 48;

void drawRay(const Track& track, double radius_m, Scan& scan) {
  const double range = track.position_m.norm();
  const double turns = std::atan2(track.position_m.y(), track.position_m.x()) / (2.0 * M_PI);
  const auto ray = static_cast<std::size_t>(std::lround((turns + 1.0) * kRays)) % kRays;
  scan.range_m[ray] = static_cast<float>(std::max(0.01, range - radius_m));
  scan.sigma_m[ray] = static_cast<float>(std::sqrt(0.5 * track.covariance.trace()));
  scan.label[ray] = RayLabel::kObstacle;
  scan.object[ray] = static_cast<std::uint16_t>(track.id);
}

}  // namespace

ObservationOptions ObservationOptions::read(const options::Section& section) {
  ObservationOptions o;
  section.read("landmark_radius_m", o.landmark_radius_m, options::kPositive);
  section.finish();
  return o;
}

const std::vector<Objects>& ObservationFrames::framesAt(TimeNs time,
                                                        const std::vector<const Report*>& reports) {
  frames_.clear();
  std::set<std::string> have;
  const auto add = [&](const std::string& robot, std::uint32_t sequence) {
    if (robots_.count(robot) == 0 || !have.insert(robot).second) return;
    Objects frame;
    frame.robot = robot;
    frame.acquired_ns = time;
    frame.sequence = sequence;
    frames_.push_back(std::move(frame));
  };
  for (const Report* report : reports) add(report->robot, report->sequence);
  for (const Report* report : reports) {
    for (const Measurement& value : report->values) add(value.to, 0);
  }
  return frames_;
}

Track ObservationFrames::landmark(const std::string& robot, const Measurement& measurement,
                                  const Eigen::Vector2d& at_m) {
  auto& ids = ids_[robot];
  Track track;
  track.name = measurement.to;
  track.id = ids.try_emplace(measurement.to, static_cast<std::uint32_t>(ids.size() + 1)).first->second;
  track.kind = ObjectKind::kObstacle;
  track.kind_probability = 1.0;
  track.visible = true;
  track.position_m = at_m;
  const double range = at_m.norm();
  const Eigen::Vector2d along = at_m / range, across(-along.y(), along.x());
  track.covariance = measurement.covariance(0, 0) * along * along.transpose() +
                     range * range * measurement.covariance(1, 1) * across * across.transpose();
  track.contact_m = at_m - options_.landmark_radius_m * along;
  for (int k = 0; k < kVertices; ++k) {
    const double phi = 2.0 * M_PI * k / kVertices;
    track.hull_m.emplace_back(at_m +
                              options_.landmark_radius_m * Eigen::Vector2d(std::cos(phi), std::sin(phi)));
  }
  track.supports = SupportFunction::of(track.hull_m, Eigen::Vector2d::Zero(), 1.0);
  for (std::size_t k = 0; k < track.supports.size(); ++k) {
    const double phi = 2.0 * M_PI * static_cast<double>(k) / static_cast<double>(track.supports.size());
    const Eigen::Vector2d n(std::cos(phi), std::sin(phi));
    track.supports.sigma_m[k] = static_cast<float>(std::sqrt(n.dot(track.covariance * n)));
  }
  return track;
}

Objects ObservationFrames::objectsOf(const Report& report, TimeNs time,
                                     const estimation::FleetEstimator& estimator,
                                     const std::set<std::string>& fleet) {
  Objects objects;
  objects.robot = report.robot;
  objects.acquired_ns = time;
  objects.sequence = report.sequence;
  objects.scan.range_m.assign(kRays, 0.0F);
  objects.scan.sigma_m.assign(kRays, 0.0F);
  objects.scan.label.assign(kRays, RayLabel::kInvalid);
  objects.scan.object.assign(kRays, 0);
  for (const Measurement& value : report.values) {
    if (value.kind != MeasurementKind::kRangeBearing || fleet.count(value.to) > 0) continue;
    const Eigen::Vector2d at_m = estimator.seenFrom(report.robot, time, value.value.head<2>());
    if (!(at_m.norm() > options_.landmark_radius_m)) continue;
    objects.tracks.push_back(landmark(report.robot, value, at_m));
    drawRay(objects.tracks.back(), options_.landmark_radius_m, objects.scan);
  }
  return objects;
}

}  // namespace omnifleet::localizer
