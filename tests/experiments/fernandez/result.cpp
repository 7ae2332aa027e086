#include "tests/experiments/fernandez/result.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>

namespace omnifleet::fernandez {
namespace {

namespace fs = std::filesystem;
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr int kPaperModules = 26, kPaperPhases = 20;  // best of set 1, §V
constexpr int kDefaultModules = 128, kDefaultPhases = 64;

enum Column { kLiteral, kNoWheels, kWheels, kOdometry, kColumns };
constexpr const char* kMethod[] = {"literal", "omnifleet", "omnifleet_wheels", ""};
constexpr const char* kRun[] = {"literal", "no_wheels", "omnifleet", ""};

double number(const nlohmann::json& json, const char* key) {
  return json.contains(key) && json.at(key).is_number() ? json.at(key).get<double>() : kNone;
}

std::string cell(double value, int decimals) {
  return std::isfinite(value) ? fmt::format("{:.{}f}", value, decimals) : std::string("-");
}

/// Median and worst of a value over the seeds.
std::string spread(std::vector<double> values, int decimals) {
  values.erase(std::remove_if(values.begin(), values.end(), [](double v) { return !std::isfinite(v); }),
               values.end());
  if (values.empty()) return "-";
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return fmt::format("{} ({})", cell(0.5 * (values[(n - 1) / 2] + values[n / 2]), decimals),
                     cell(values.back(), decimals));
}

double run(const SetFigures& set, const char* name, double RunFigures::*part) {
  const auto found = set.runs.find(name);
  return found == set.runs.end() ? kNone : found->second.*part;
}

struct Line {
  std::string what, paper;
  int decimals;
  std::function<double(const SetFigures&, Column)> value;
};

/// A value of the study, for methods and, with an empty method, the odometry.
std::function<double(const SetFigures&, Column)> shapeAt(int step, int k1, int k2) {
  return [=](const SetFigures& set, Column column) {
    if (!set.study) return kNone;
    if (column == kOdometry) {
      const auto& odometry = set.study->odometry;
      return static_cast<int>(odometry.size()) >= step ? odometry[static_cast<std::size_t>(step - 1)] : kNone;
    }
    return at(*set.study, kMethod[column], step, k1, k2);
  };
}

std::vector<Line> lines(int number) {
  const bool first = number == 1;
  std::vector<Line> all;
  all.push_back({"best of all k1 and k2, every image", first ? "0.04" : "0.015", 5,
                 [](const SetFigures& set, Column column) {
                   return set.study && column != kOdometry ? least(*set.study, kMethod[column], 1) : kNone;
                 }});
  const int k1 = first ? kPaperModules : 4, k2 = first ? kPaperPhases : 8;
  all.push_back({fmt::format("k1 = {}, k2 = {}", k1, k2), first ? "0.04" : "0.015", 5, shapeAt(1, k1, k2)});
  for (int step = 1; step <= kSteps; ++step)
    all.push_back({step == 1 ? std::string("k1 = k2 = 64, every image")
                             : fmt::format("k1 = k2 = 64, one image in {}", step),
                   "-", 5, shapeAt(step, kFigureTerms, kFigureTerms)});
  all.push_back({"k1 = k2 = 64, steps halfway", "-", 5, [](const SetFigures& set, Column column) {
                   return set.study && column == kLiteral
                              ? at(*set.study, "literal_midway", 1, kFigureTerms, kFigureTerms)
                              : kNone;
                 }});
  all.push_back({"k1 = 128, k2 = 64 (default)", "-", 5, shapeAt(1, kDefaultModules, kDefaultPhases)});
  all.push_back({"replay: topological map", "-", 6, [](const SetFigures& set, Column column) {
                   return run(set, kRun[column], &RunFigures::places);
                 }});
  all.push_back({"replay: path", "-", 6, [](const SetFigures& set, Column column) {
                   return run(set, kRun[column], &RunFigures::path);
                 }});
  all.push_back({"time of the map, k1 = k2 = 64, ms", "-", 1, [](const SetFigures& set, Column column) {
                   if (!set.study) return kNone;
                   const auto surface = set.study->build_s.find(kMethod[column]);
                   if (surface == set.study->build_s.end()) return kNone;
                   const auto& terms = set.study->terms;
                   const auto k = static_cast<std::size_t>(
                       std::find(terms.begin(), terms.end(), kFigureTerms) - terms.begin());
                   return 1e3 * surface->second.at(0).at(k).at(k);
                 }});
  return all;
}

std::size_t indexOf(const std::vector<int>& terms, int term) {
  return static_cast<std::size_t>(std::find(terms.begin(), terms.end(), term) - terms.begin());
}

}  // namespace

double at(const StudyResult& study, const std::string& method, int step, int k1, int k2) {
  const auto found = study.shape.find(method);
  const std::size_t row = indexOf(study.terms, k1), column = indexOf(study.terms, k2);
  if (found == study.shape.end() || static_cast<int>(found->second.size()) < step ||
      row >= study.terms.size() || column >= study.terms.size())
    return kNone;
  return found->second[static_cast<std::size_t>(step - 1)][row][column];
}

double least(const StudyResult& study, const std::string& method, int step) {
  double best = kNone;
  for (const int k1 : study.terms)
    for (const int k2 : study.terms) best = std::fmin(best, at(study, method, step, k1, k2));
  return best;
}

RunFigures RunFigures::load(const std::string& run) try {
  std::ifstream file(run + "/metrics.json");
  const nlohmann::json json = nlohmann::json::parse(file);
  const nlohmann::json& robot = json.at("paths").front();
  RunFigures figures;
  figures.path = number(robot, "shape_difference");
  figures.places = number(robot, "places_shape_difference");
  figures.distance_m = number(robot, "distance_m");
  figures.nodes = robot.value("places", 0);
  return figures;
} catch (const nlohmann::json::exception& error) {
  throw std::runtime_error(run + "/metrics.json: " + error.what());
}

SetFigures SetFigures::load(const std::string& folder) {
  SetFigures set;
  if (fs::exists(folder + "/study.json")) set.study = StudyResult::load(folder + "/study.json");
  for (const char* name : {"literal", "no_wheels", "omnifleet"}) {
    const std::string run = folder + "/" + name;
    if (fs::exists(run + "/metrics.json")) set.runs[name] = RunFigures::load(run);
  }
  return set;
}

SeedFigures SeedFigures::load(const std::string& out, std::uint32_t seed) {
  SeedFigures figures;
  figures.seed = seed;
  for (const int number : {1, 2})
    figures.sets[number] =
        SetFigures::load(out + "/seed_" + std::to_string(seed) + "/set" + std::to_string(number));
  return figures;
}

std::string heading() {
  return fmt::format("{:>5} {:>3} {:>6} {:>6}  {:>8} {:>8} {:>8} {:>8}  {:>8} {:>8} {:>8}  {:>8} {:>8}\n",
                     "seed", "set", "images", "m", "odometry", "literal", "no whls", "wheels", "literal",
                     "no whls", "wheels", "no whls", "wheels") +
         fmt::format("{:>5} {:>3} {:>6} {:>6}  {:^35}  {:^26}  {:^17}\n", "", "", "", "",
                     "maps of k1 = k2 = 64", "replay: maps", "replay: paths");
}

std::string rows(const SeedFigures& seed) {
  std::string text;
  for (const auto& [number, set] : seed.sets) {
    if (!set.study) continue;
    const auto shape = shapeAt(1, kFigureTerms, kFigureTerms);
    text += fmt::format(
        "{:>5} {:>3} {:>6} {:>6.1f}  {:>8} {:>8} {:>8} {:>8}  {:>8} {:>8} {:>8}  {:>8} {:>8}\n", seed.seed,
        number, set.study->images, set.study->length_m, cell(shape(set, kOdometry), 5),
        cell(shape(set, kLiteral), 5), cell(shape(set, kNoWheels), 5), cell(shape(set, kWheels), 5),
        cell(run(set, "literal", &RunFigures::places), 6),
        cell(run(set, "no_wheels", &RunFigures::places), 6),
        cell(run(set, "omnifleet", &RunFigures::places), 6),
        cell(run(set, "no_wheels", &RunFigures::path), 6), cell(run(set, "omnifleet", &RunFigures::path), 6));
  }
  return text;
}

std::string report(const std::vector<SeedFigures>& seeds) {
  std::string text;
  for (const int number : {1, 2}) {
    std::vector<const SetFigures*> sets;
    for (const SeedFigures& seed : seeds) {
      const auto found = seed.sets.find(number);
      if (found != seed.sets.end() && found->second.study) sets.push_back(&found->second);
    }
    if (sets.empty()) continue;
    text += fmt::format("Set {}: {}, {} seed{}; shape difference to the truth, median (worst)\n", number,
                        number == 1 ? "200 images 10 cm apart with a loop" : "150 images by a threshold",
                        sets.size(), sets.size() == 1 ? "" : "s");
    text += fmt::format("  {:<36} {:>6} {:>18} {:>22} {:>22} {:>18}\n", "", "paper", "literal",
                        "omnifleet, no wheels", "omnifleet", "odometry");
    for (const Line& line : lines(number)) {
      text += fmt::format("  {:<36} {:>6}", line.what, line.paper);
      for (const Column column : {kLiteral, kNoWheels, kWheels, kOdometry}) {
        std::vector<double> values;
        for (const SetFigures* set : sets) values.push_back(line.value(*set, column));
        const int width = column == kLiteral || column == kOdometry ? 18 : 22;
        text += fmt::format(" {:>{}}", spread(values, line.decimals), width);
      }
      text += "\n";
    }
    text += "\n";
  }
  return text;
}

}  // namespace omnifleet::fernandez
