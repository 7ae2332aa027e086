#include "tests/experiments/ahmed/result.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "dataset/dataset.h"

namespace omnifleet::ahmed {
namespace {

namespace fs = std::filesystem;
constexpr double kNone = std::numeric_limits<double>::quiet_NaN(), kDegrees = 180.0 / M_PI;

double number(const nlohmann::json& json, const std::string& pointer) {
  const nlohmann::json::json_pointer at(pointer);
  return json.contains(at) && json.at(at).is_number() ? json.at(at).get<double>() : kNone;
}

/// Bytes that the services of a robot sent to other hosts, from the last lines of their logs.
double sentBytes(const fs::path& log, const std::string& robot) {
  static const std::string kBefore = "topics that other hosts read: sent ";
  double sum = 0.0;
  bool any = false;
  if (!fs::is_directory(log)) return kNone;
  for (const auto& entry : fs::directory_iterator(log)) {
    const std::string stem = entry.path().stem().string(), end = "_" + robot;
    if (stem.size() < end.size() || stem.compare(stem.size() - end.size(), end.size(), end) != 0) continue;
    std::ifstream file(entry.path());
    for (std::string line; std::getline(file, line);) {
      const std::size_t at = line.find(kBefore);
      if (at == std::string::npos) continue;
      sum += std::stod(line.substr(at + kBefore.size()));
      any = true;
    }
  }
  return any ? sum : kNone;
}

struct Column {
  const char* name;
  const char* unit;
  double factor;
  int decimals;
  double RunFigures::*part;
  bool is_more_better;
};

const std::vector<Column>& columns() {
  static const std::vector<Column> kColumns{{"faces", "%", 100.0, 1, &RunFigures::faces_occupied, true},
                                            {"floor", "%", 100.0, 1, &RunFigures::free_complete, true},
                                            {"wrong", "%", 100.0, 2, &RunFigures::free_wrong, false},
                                            {"1.5cm", "%", 100.0, 1, &RunFigures::within_1_5cm, true},
                                            {"near", "cm", 100.0, 2, &RunFigures::near_error_m, false},
                                            {"far", "cm", 100.0, 2, &RunFigures::far_error_m, false},
                                            {"thick", "", 1.0, 2, &RunFigures::per_crossed, false},
                                            {"robots", "cells", 1.0, 0, &RunFigures::on_robots, false},
                                            {"pose", "mm", 1000.0, 2, &RunFigures::position_m, false},
                                            {"heading", "deg", kDegrees, 2, &RunFigures::heading_rad, false},
                                            {"sent", "kB/s", 1e-3, 1, &RunFigures::sent_bytes_per_s, false},
                                            {"time", "s", 1.0, 0, &RunFigures::recorded_s, false}};
  return kColumns;
}

std::string cell(double value, int decimals) {
  return std::isfinite(value) ? fmt::format("{:.{}f}", value, decimals) : std::string("-");
}

/// Median and worst of a column over the runs of one name.
struct Spread {
  double median = kNone, worst = kNone;
  int count = 0;
};

Spread spreadOf(const std::vector<SeedFigures>& seeds, const std::string& run, const Column& column) {
  std::vector<double> values;
  for (const SeedFigures& seed : seeds) {
    const auto found = seed.runs.find(run);
    if (found != seed.runs.end() && std::isfinite(found->second.*column.part))
      values.push_back(column.factor * found->second.*column.part);
  }
  Spread spread;
  spread.count = static_cast<int>(values.size());
  if (values.empty()) return spread;
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  spread.median = 0.5 * (values[(n - 1) / 2] + values[n / 2]);
  spread.worst = column.is_more_better ? values.front() : values.back();
  return spread;
}

std::string text(const Spread& spread, int decimals) {
  if (spread.count == 0) return "-";
  return fmt::format("{} ({})", cell(spread.median, decimals), cell(spread.worst, decimals));
}

struct Line {
  const char* what;
  const char* paper;
  double RunFigures::*part;
};

std::string mainTable(const std::vector<SeedFigures>& seeds) {
  static const std::vector<Line> kLines{
      {"faces seen within 1.8 m that are occupied, %", "not all", &RunFigures::faces_occupied},
      {"floor of the room that is free in the map, %", "-", &RunFigures::free_complete},
      {"free cells inside obstacles or outside, %", "-", &RunFigures::free_wrong},
      {"occupied cells within 1.5 cm of a true face, %", "-", &RunFigures::within_1_5cm},
      {"error of faces seen within 1 m, cm", "-", &RunFigures::near_error_m},
      {"error of other faces, cm", "more", &RunFigures::far_error_m},
      {"occupied cells per cell that a face crosses", "-", &RunFigures::per_crossed},
      {"occupied cells on robots", "some", &RunFigures::on_robots},
      {"error of poses, mm", "-", &RunFigures::position_m},
      {"error of headings, deg", "-", &RunFigures::heading_rad},
      {"sent per mapping robot, kB/s", "-", &RunFigures::sent_bytes_per_s},
      {"recorded time, s", "261", &RunFigures::recorded_s}};
  std::string table =
      fmt::format("{:<48} {:>8} {:>20} {:>20}\n", "median (worst)", "paper", "literal", "omnifleet");
  for (const Line& line : kLines) {
    const auto column = std::find_if(columns().begin(), columns().end(),
                                     [&](const Column& c) { return c.part == line.part; });
    table += fmt::format("{:<48} {:>8} {:>20} {:>20}\n", line.what, line.paper,
                         text(spreadOf(seeds, "literal", *column), column->decimals),
                         text(spreadOf(seeds, "omnifleet", *column), column->decimals));
  }
  return table;
}

/// The seeds that have runs on the recordings with old ceiling images.
std::string staleTable(std::vector<SeedFigures> seeds) {
  seeds.erase(std::remove_if(seeds.begin(), seeds.end(),
                             [](const SeedFigures& seed) {
                               return seed.runs.count("stale/omnifleet") == 0 ||
                                      seed.runs.count("waiting/omnifleet") == 0;
                             }),
              seeds.end());
  if (seeds.empty()) return {};
  std::string table = fmt::format(
      "\nCost of a stale heading, {} seed{}: ceiling images show the robots 0.2 s before their time stamps\n"
      "{:<38} {:>12}",
      seeds.size(), seeds.size() == 1 ? "" : "s", "median (worst)", "method");
  const std::vector<std::pair<const char*, double RunFigures::*>> shown{
      {"heading, deg", &RunFigures::heading_rad}, {"pose, mm", &RunFigures::position_m},
      {"near, cm", &RunFigures::near_error_m},    {"within 1.5 cm, %", &RunFigures::within_1_5cm},
      {"on robots", &RunFigures::on_robots},      {"time, s", &RunFigures::recorded_s}};
  for (const auto& [name, part] : shown) table += fmt::format(" {:>18}", name);
  table += "\n";
  for (const auto& [folder, what] :
       {std::pair{"", "moving, images of that time"}, std::pair{"stale/", "moving, images 0.2 s old"},
        std::pair{"waiting/", "stop-and-wait, images 0.2 s old"}}) {
    for (const std::string method : {"literal", "omnifleet"}) {
      table += fmt::format("{:<38} {:>12}", what, method);
      for (const auto& entry : shown) {
        const auto part = entry.second;
        const auto column =
            std::find_if(columns().begin(), columns().end(), [&](const Column& c) { return c.part == part; });
        table += fmt::format(" {:>18}", text(spreadOf(seeds, folder + method, *column), column->decimals));
      }
      table += "\n";
    }
  }
  return table;
}

}  // namespace

RunFigures RunFigures::load(const std::string& run, const std::string& recording) {
  std::ifstream file(run + "/metrics.json");
  if (!file) throw std::runtime_error(run + "/metrics.json: cannot be read");
  const auto json = nlohmann::json::parse(file);
  RunFigures figures;
  figures.faces_occupied = number(json, "/cells/all/seen_occupied");
  figures.within_1_5cm = number(json, "/cells/all/within_1_5cm");
  figures.near_error_m = number(json, "/cells/near_error_m");
  figures.far_error_m = number(json, "/cells/far_error_m");
  figures.per_crossed = number(json, "/cells/occupied_per_crossed");
  figures.on_robots = number(json, "/cells/on_robots");
  figures.free_complete = number(json, "/cells/free_complete");
  figures.free_wrong = number(json, "/cells/free_wrong");
  const dataset::Dataset data = dataset::Dataset::open(recording);
  double robots = 0.0, sent = 0.0, position = 0.0, heading = 0.0;
  for (const dataset::RobotRecording& robot : data.robots) {
    if (!robot.front || robot.front->rows.empty()) continue;
    robots += 1.0;
    figures.recorded_s = std::max(
        figures.recorded_s,
        1e-9 * static_cast<double>(robot.front->rows.back().time_ns - robot.front->rows.front().time_ns));
    sent += sentBytes(fs::path(run) / "log", robot.name);
    position += number(json, "/paths/" + robot.name + "/distance_m");
    heading += number(json, "/paths/" + robot.name + "/heading_rad");
  }
  figures.position_m = position / robots;
  figures.heading_rad = heading / robots;
  figures.sent_bytes_per_s = sent / robots / figures.recorded_s;
  return figures;
}

SeedFigures SeedFigures::load(const std::string& out, std::uint32_t seed) {
  SeedFigures figures;
  figures.seed = seed;
  const fs::path folder = fs::path(out) / fmt::format("seed_{}", seed);
  for (const std::string& part : {std::string(), std::string("stale/"), std::string("waiting/")})
    for (const std::string method : {"literal", "omnifleet"})
      if (fs::exists(folder / (part + method) / "metrics.json"))
        figures.runs[part + method] =
            RunFigures::load((folder / (part + method)).string(), (folder / (part + "recording")).string());
  return figures;
}

std::string heading() {
  std::string names = fmt::format("{:>6} {:<10}", "seed", "method"),
              units = fmt::format("{:>6} {:<10}", "", "");
  for (const Column& column : columns()) {
    names += fmt::format(" {:>7}", column.name);
    units += fmt::format(" {:>7}", column.unit);
  }
  return names + "\n" + units + "\n";
}

std::string rows(const SeedFigures& seed) {
  std::string table;
  for (const std::string method : {"literal", "omnifleet"}) {
    const auto run = seed.runs.find(method);
    if (run == seed.runs.end()) continue;
    table += fmt::format("{:>6} {:<10}", seed.seed, method);
    for (const Column& column : columns())
      table += fmt::format(" {:>7}", cell(column.factor * run->second.*column.part, column.decimals));
    table += "\n";
  }
  return table;
}

std::string report(const std::vector<SeedFigures>& seeds) {
  if (seeds.empty()) return "no seed is finished\n";
  return fmt::format(
             "Ahmed et al. 2013, repeated over {} seeds ({} to {}); layouts 1 and 2 of the arena in turn.\n"
             "paper: what the paper reports. literal: its method as printed (config/papers/ahmed.yaml) with "
             "a fitted "
             "scale.\nomnifleet: default options. Cells of 2 cm.\n\n",
             seeds.size(), seeds.front().seed, seeds.back().seed) +
         mainTable(seeds) + staleTable(seeds);
}

}  // namespace omnifleet::ahmed
