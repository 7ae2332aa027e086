#include "tests/experiments/fernandez/topology.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <stdexcept>

#include "appearance/compass.h"
#include "appearance/stored_signature.h"
#include "appearance/topological_map.h"

namespace omnifleet::fernandez {
namespace {

bool isLiteral(Method method) {
  return method == Method::kLiteral || method == Method::kLiteralMidway;
}

const appearance::Signature& signatureOf(const SetImage& image, Method method) {
  return isLiteral(method) ? image.rows : image.pooled;
}

std::vector<const SetImage*> everyNth(const ImageSet& set, int step) {
  std::vector<const SetImage*> images;
  for (std::size_t i = 0; i < set.images.size(); i += static_cast<std::size_t>(step))
    images.push_back(&set.images[i]);
  return images;
}

appearance::Compass compassFor(Method method, int k2) {
  appearance::CompassOptions options;
  options.k2 = k2;
  options.least_confidence = 0.0;  // the map needs every turn
  if (isLiteral(method)) options.method = appearance::CompassMethod::kLiteral;
  return appearance::Compass(options);
}

/// Eq. 2 with k1 modules per row. Divided by the mean norm of both, unless the method is that of the paper.
double differenceOf(const SetImage& a, const SetImage& b, Method method, int k1) {
  const auto of_a = signatureOf(a, method).modules.leftCols(k1),
             of_b = signatureOf(b, method).modules.leftCols(k1);
  const auto distance = static_cast<double>((of_a - of_b).matrix().norm());
  if (method == Method::kLiteral) return distance;
  const double mean = 0.5 * static_cast<double>(of_a.matrix().norm() + of_b.matrix().norm());
  return mean > 0.0 ? distance / mean : 0.0;
}

/// Wheels: signed length of the displacement between two images.
double rolled_m(const SetImage& from, const SetImage& to) {
  const Eigen::Vector2d way = (from.odometry.inverse() * to.odometry).translation();
  return way.x() < 0.0 ? -way.norm() : way.norm();
}

appearance::TravelHint hintOf(const SetImage& from, const SetImage& to, Method method) {
  appearance::TravelHint hint;
  if (method != Method::kWheels) return hint;
  const double way_m = rolled_m(from, to);
  hint.distance_m = std::abs(way_m);
  if (way_m < 0.0) hint.bearing_rad = M_PI;
  return hint;
}

appearance::TopologicalMap emptyMap(Method method, const SignatureFormat& format) {
  appearance::TopologicalMapOptions options;
  options.use_wheels = method == Method::kWheels;
  options.midway = method != Method::kLiteral;
  return appearance::TopologicalMap("r1", "map", format, options);
}

}  // namespace

const std::vector<Method>& methods() {
  static const std::vector<Method> kMethods{Method::kLiteral, Method::kLiteralMidway, Method::kOmnifleet,
                                            Method::kWheels};
  return kMethods;
}

std::string nameOf(Method method) {
  switch (method) {
    case Method::kLiteral:
      return "literal";
    case Method::kLiteralMidway:
      return "literal_midway";
    case Method::kOmnifleet:
      return "omnifleet";
    case Method::kWheels:
      return "omnifleet_wheels";
  }
  return "";
}

const std::vector<int>& sweptFrequencies() {
  static const std::vector<int> kSwept{4, 8, 16, 20, 26, 32, 64, 128, kFrequencies};
  return kSwept;
}

Relations::Relations(const ImageSet& set, Method method, int step)
    : method_(method), images_(everyNth(set, step)) {
  if (method == Method::kWheels && !set.has_wheels)
    throw std::invalid_argument("topology: the set has no wheels");
  for (const int k : sweptFrequencies()) {
    appearance::Compass compass = compassFor(method, k);
    std::vector<Turn> turns;
    std::vector<double> differences;
    appearance::Compass::View before = compass.prepare(signatureOf(*images_.front(), method));
    for (std::size_t i = 1; i < images_.size(); ++i) {
      const SetImage &from = *images_[i - 1], &to = *images_[i];
      appearance::Compass::View view = compass.prepare(signatureOf(to, method));
      const auto found = compass.compare(before, view, hintOf(from, to, method));
      turns.push_back({found.turn_rad, found.valid ? found.sigma_rad : 0.0});
      differences.push_back(differenceOf(from, to, method, k));
      before = std::move(view);
    }
    turns_.push_back(std::move(turns));
    differences_.push_back(std::move(differences));
  }
}

std::size_t Relations::indexOf(int frequency) const {
  const auto& swept = sweptFrequencies();
  const auto found = std::find(swept.begin(), swept.end(), frequency);
  if (found == swept.end()) throw std::invalid_argument("topology: k1 and k2 must be swept ones");
  return static_cast<std::size_t>(found - swept.begin());
}

std::vector<Eigen::Vector2d> Relations::layOut(int k1, int k2) const {
  const std::vector<Turn>& turns = turns_[indexOf(k2)];
  const std::vector<double>& differences = differences_[indexOf(k1)];
  const StoredSignature stored = appearance::store(images_.front()->pooled);
  appearance::TopologicalMap map = emptyMap(method_, images_.front()->pooled.format);
  for (std::size_t i = 0; i < images_.size(); ++i) {
    std::optional<appearance::Transition> transition;
    if (i > 0) {
      transition.emplace();
      transition->turn_rad = turns[i - 1].rad;
      transition->turn_sigma_rad = turns[i - 1].sigma_rad;
      transition->difference = differences[i - 1];
      if (method_ == Method::kWheels) transition->displacement_m = rolled_m(*images_[i - 1], *images_[i]);
    }
    map.add(images_[i]->time_ns, images_[i]->sequence, stored, transition);
  }
  std::vector<Eigen::Vector2d> points;
  for (const Place& place : map.places()) points.push_back(place.frame_from_base.translation());
  return points;
}

double buildTime_s(const ImageSet& set, Method method, int step, int k1, int k2) {
  const std::vector<const SetImage*> images = everyNth(set, step);
  appearance::Compass compass = compassFor(method, k2);
  std::vector<appearance::Compass::View> views;
  for (const SetImage* image : images) views.push_back(compass.prepare(signatureOf(*image, method)));
  const StoredSignature stored = appearance::store(images.front()->pooled);
  appearance::TopologicalMap map = emptyMap(method, images.front()->pooled.format);
  map.add(images.front()->time_ns, images.front()->sequence, stored, std::nullopt);
  const auto begun = std::chrono::steady_clock::now();
  for (std::size_t i = 1; i < images.size(); ++i) {
    const SetImage &from = *images[i - 1], &to = *images[i];
    const auto found = compass.compare(views[i - 1], views[i], hintOf(from, to, method));
    appearance::Transition transition;
    transition.turn_rad = found.turn_rad;
    transition.turn_sigma_rad = found.valid ? found.sigma_rad : 0.0;
    transition.difference = differenceOf(from, to, method, k1);
    map.add(to.time_ns, to.sequence, stored, transition);
  }
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
}

}  // namespace omnifleet::fernandez
