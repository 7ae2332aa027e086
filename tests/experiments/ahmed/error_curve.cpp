#include "tests/experiments/ahmed/error_curve.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include "dataset/dataset.h"
#include "dataset/frame_source.h"
#include "dataset/ground_truth.h"
#include "distance_vector/distance_vector.h"
#include "fleet/fleet.h"
#include "local_mapper/front_service.h"
#include "tests/experiments/plot/plot.h"

namespace omnifleet::ahmed {
namespace {

constexpr double kBin_m = 0.1, kFarthest_m = 1.5, kInfinite = std::numeric_limits<double>::infinity();
constexpr double kNearest_m = 0.2;  // drawn: nearer objects are below the image of a camera 8.5 cm high
constexpr int kLeast = 50;          // bearings per bin, drawn

/// Distance along a unit vector to the outline of a polygon; infinite if the ray misses it.
double rangeTo(const Polygon& polygon, const Eigen::Vector2d& from, const Eigen::Vector2d& along) {
  double nearest = kInfinite;
  const Eigen::Vector2d normal(-along.y(), along.x());
  for (std::size_t k = 0; k < polygon.size(); ++k) {
    const Eigen::Vector2d a = polygon[k] - from, b = polygon[(k + 1) % polygon.size()] - from;
    const double side_a = normal.dot(a), side_b = normal.dot(b);
    if ((side_a > 0.0) == (side_b > 0.0)) continue;
    const double range = along.dot(a + side_a / (side_a - side_b) * (b - a));
    if (range > 0.0) nearest = std::min(nearest, range);
  }
  return nearest;
}

class Truth {
 public:
  explicit Truth(const std::string& recording)
      : truth_(dataset::GroundTruth::load(recording)),
        bodies_(fleet::Fleet::load("", recording, {}).bodies()) {}

  const std::vector<dataset::StampedPose>& path(const std::string& robot) const {
    return truth_.trajectories.at(robot);
  }

  /// Nothing where the ray meets a robot first.
  std::optional<double> range(const std::string& robot, TimeNs time_ns, const Eigen::Vector2d& from,
                              const Eigen::Vector2d& along) const {
    double nearest = rangeTo(truth_.room, from, along);
    for (const dataset::MapObject& object : truth_.scene)
      nearest = std::min(nearest, rangeTo(object.outline_m, from, along));
    for (const auto& [name, body] : bodies_) {
      if (name == robot) continue;
      Polygon outline = body.outline();
      const Pose2 at = poseAt(name, time_ns);
      for (Eigen::Vector2d& corner : outline) corner = at * corner;
      if (rangeTo(outline, from, along) < nearest + kBodyMargin_m) return std::nullopt;
    }
    if (!std::isfinite(nearest)) return std::nullopt;
    return nearest;
  }

 private:
  static constexpr double kBodyMargin_m = 0.05;  // what stands just behind a robot touches it in the image

  Pose2 poseAt(const std::string& robot, TimeNs time_ns) const {
    const auto& poses = path(robot);
    return std::min_element(poses.begin(), poses.end(),
                            [&](const auto& a, const auto& b) {
                              return std::abs(a.time_ns - time_ns) < std::abs(b.time_ns - time_ns);
                            })
        ->map_from_base;
  }

  dataset::GroundTruth truth_;
  std::map<std::string, RobotBody> bodies_;
};

using Samples = std::vector<std::vector<double>>;  // errors per bin

/// A ray of a scan that ends at an obstacle.
struct Ray {
  Eigen::Vector2d from, along;  // in map
  double range_m = 0.0;
};

std::optional<Ray> rayOf(const Scan& scan, std::size_t i, const Pose2& map_from_base) {
  if (scan.label[i] != RayLabel::kObstacle) return std::nullopt;
  const double bearing = 2.0 * M_PI * static_cast<double>(i) / static_cast<double>(scan.range_m.size());
  const double direction = map_from_base.theta_rad + bearing;
  return Ray{map_from_base * scan.origin_m,
             {std::cos(direction), std::sin(direction)},
             static_cast<double>(scan.range_m[i])};
}

void add(const Scan& scan, const Truth& truth, const std::string& robot, const dataset::StampedPose& pose,
         Samples& samples) {
  for (std::size_t i = 0; i < scan.label.size(); ++i) {
    const auto ray = rayOf(scan, i, pose.map_from_base);
    if (!ray) continue;
    const auto exact = truth.range(robot, pose.time_ns, ray->from, ray->along);
    if (!exact) continue;
    const double from_base_m = (ray->from + *exact * ray->along - pose.map_from_base.translation()).norm();
    const auto bin = static_cast<std::size_t>(from_base_m / kBin_m);
    if (bin < samples.size()) samples[bin].push_back(std::abs(ray->range_m - *exact));
  }
}

DistanceErrors errorsOf(std::vector<double>& values) {
  DistanceErrors errors;
  errors.count = static_cast<int>(values.size());
  if (values.empty()) return errors;
  std::sort(values.begin(), values.end());
  const auto at = [&](double share) {
    return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
  };
  errors.median_m = at(0.5);
  errors.share90_m = at(0.9);
  return errors;
}

}  // namespace

ErrorCurve errorCurve(const std::vector<std::string>& recordings, const std::vector<std::string>& overlays) {
  const auto bins = static_cast<std::size_t>(std::lround(kFarthest_m / kBin_m));
  Samples literal(bins), projected(bins);
  ErrorCurve curve;
  for (const std::string& recording : recordings) {
    const Truth truth(recording);
    const auto options = services::frontOptions(fleet::Fleet::load("", recording, overlays)).distance_vector;
    for (const dataset::RobotRecording& robot : dataset::Dataset::open(recording).robots) {
      if (!robot.front) continue;
      const lens::Camera camera(robot.front->camera);
      distance_vector::DistanceVector paper(camera, options), ours(camera, {});
      std::map<TimeNs, Pose2> poses;
      for (const dataset::StampedPose& pose : truth.path(robot.name))
        poses[pose.time_ns] = pose.map_from_base;
      const auto source = dataset::openStream(*robot.front, dataset::Colour::kBgr);
      cv::Mat image;
      dataset::FrameInfo info;
      while (source->next(image, info)) {
        const auto pose = poses.find(info.time_ns);
        if (info.state != FrameState::kOk || pose == poses.end()) continue;
        paper.process(image);
        ours.process(image);
        add(paper.scan(), truth, robot.name, {info.time_ns, pose->second}, literal);
        add(ours.scan(), truth, robot.name, {info.time_ns, pose->second}, projected);
      }
    }
  }
  for (std::size_t bin = 0; bin < bins; ++bin) {
    curve.distance_m.push_back((static_cast<double>(bin) + 0.5) * kBin_m);
    curve.literal.push_back(errorsOf(literal[bin]));
    curve.omnifleet.push_back(errorsOf(projected[bin]));
  }
  return curve;
}

std::string ErrorCurve::csv() const {
  std::string text =
      "distance_m,literal_count,literal_median_cm,literal_p90_cm,omnifleet_count,omnifleet_median_cm,"
      "omnifleet_p90_cm\n";
  const auto cells = [](const DistanceErrors& errors) {
    return errors.count == 0 ? std::string("0,,")
                             : fmt::format("{},{:.3f},{:.3f}", errors.count, 100.0 * errors.median_m,
                                           100.0 * errors.share90_m);
  };
  for (std::size_t bin = 0; bin < distance_m.size(); ++bin)
    text += fmt::format("{:.2f},{},{}\n", distance_m[bin], cells(literal[bin]), cells(omnifleet[bin]));
  return text;
}

void drawErrorCurve(const ErrorCurve& curve, const std::string& path) {
  experiments::Axes axes;
  axes.title = "Error of the distance vector at true poses";
  axes.x_label = "true distance from base_link (m)";
  axes.y_label = "error of the distance (cm)";
  axes.low = {kNearest_m, 0.0};
  axes.high = {kNearest_m, 1.0};
  const auto pointsOf = [&](const std::vector<DistanceErrors>& errors, double DistanceErrors::*part) {
    std::vector<Eigen::Vector2d> points;
    for (std::size_t bin = 0; bin < errors.size(); ++bin)
      if (errors[bin].count >= kLeast && curve.distance_m[bin] > kNearest_m)
        points.emplace_back(curve.distance_m[bin], 100.0 * errors[bin].*part);
    return points;
  };
  for (const auto* errors : {&curve.literal, &curve.omnifleet})
    for (const Eigen::Vector2d& point : pointsOf(*errors, &DistanceErrors::share90_m))
      axes.high = axes.high.cwiseMax(Eigen::Vector2d(point.x() + 0.05, 1.05 * point.y()));
  experiments::Plot plot(axes);
  namespace ink = experiments::ink;
  const auto draw = [&](const std::vector<DistanceErrors>& errors, const cv::Scalar& colour,
                        const std::string& name) {
    plot.line(pointsOf(errors, &DistanceErrors::median_m), {colour, 2, false, false, name + ", median"});
    plot.line(pointsOf(errors, &DistanceErrors::share90_m), {colour, 2, true, false, name + ", 90 %"});
  };
  draw(curve.literal, ink::kOrange, "literal, eq. 1-5");
  draw(curve.omnifleet, ink::kBlue, "omnifleet");
  experiments::save(path, plot.image());
}

}  // namespace omnifleet::ahmed
