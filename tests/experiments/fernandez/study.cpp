#include "tests/experiments/fernandez/study.h"

#include <algorithm>
#include <fstream>
#include <limits>
#include <stdexcept>

#include "evaluation/shape.h"

namespace omnifleet::fernandez {
namespace {

constexpr int kTimedSteps = 2;  // Figs. 10 and 11
constexpr int kRepeats = 5;     // the fastest counts: other processes only slow it down

using Points = std::vector<Eigen::Vector2d>;

Surface shapeSurface(const Relations& relations, const Points& truth) {
  Surface surface;
  for (const int k1 : sweptFrequencies()) {
    surface.emplace_back();
    for (const int k2 : sweptFrequencies())
      surface.back().push_back(evaluation::shapeDifference(truth, relations.layOut(k1, k2)));
  }
  return surface;
}

Surface timeSurface(const ImageSet& set, Method method, int step) {
  Surface surface;
  for (const int k1 : sweptFrequencies()) {
    surface.emplace_back();
    for (const int k2 : sweptFrequencies()) {
      double least = std::numeric_limits<double>::infinity();
      for (int i = 0; i < kRepeats; ++i) least = std::min(least, buildTime_s(set, method, step, k1, k2));
      surface.back().push_back(least);
    }
  }
  return surface;
}

nlohmann::json toJson(const Points& points) {
  nlohmann::json json = nlohmann::json::array();
  for (const Eigen::Vector2d& point : points) json.push_back({point.x(), point.y()});
  return json;
}

}  // namespace

nlohmann::json StudyResult::toJson() const {
  nlohmann::json json{{"images", images}, {"length_m", length_m}, {"terms", terms},
                      {"shape", shape},   {"build_s", build_s},   {"odometry", odometry}};
  for (const auto& [name, points] : paths) json["paths"][name] = fernandez::toJson(points);
  return json;
}

StudyResult StudyResult::load(const std::string& path) try {
  std::ifstream file(path);
  const nlohmann::json json = nlohmann::json::parse(file);
  StudyResult result;
  json.at("images").get_to(result.images);
  json.at("length_m").get_to(result.length_m);
  json.at("terms").get_to(result.terms);
  json.at("shape").get_to(result.shape);
  json.at("build_s").get_to(result.build_s);
  json.at("odometry").get_to(result.odometry);
  for (const auto& [name, points] : json.at("paths").items())
    for (const auto& point : points) result.paths[name].emplace_back(point.at(0), point.at(1));
  return result;
} catch (const nlohmann::json::exception& error) {
  throw std::runtime_error(path + ": " + error.what());
}

StudyResult study(const ImageSet& set, bool timed) {
  StudyResult result;
  result.images = static_cast<int>(set.images.size());
  result.length_m = set.length_m();
  result.terms = sweptFrequencies();
  result.paths["truth"] = set.truth(1);
  for (int step = 1; set.has_wheels && step <= kSteps; ++step)
    result.odometry.push_back(evaluation::shapeDifference(set.truth(step), set.odometry(step)));
  if (set.has_wheels) result.paths["odometry"] = set.odometry(1);
  for (const Method method : methods()) {
    if (method == Method::kWheels && !set.has_wheels) continue;
    const std::string name = nameOf(method);
    for (int step = 1; step <= kSteps; ++step) {
      const Relations relations(set, method, step);
      result.shape[name].push_back(shapeSurface(relations, set.truth(step)));
      if (step == 1) result.paths[name] = relations.layOut(kFigureTerms, kFigureTerms);
    }
    if (!timed || (method != Method::kLiteral && method != Method::kOmnifleet)) continue;
    for (int step = 1; step <= kTimedSteps; ++step)
      result.build_s[name].push_back(timeSurface(set, method, step));
  }
  return result;
}

}  // namespace omnifleet::fernandez
