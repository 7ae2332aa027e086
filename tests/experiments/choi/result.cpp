#include "result.h"

#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "dataset/atomic_file.h"

namespace omnifleet::choi {
namespace {

using Json = nlohmann::ordered_json;

/// JSON has no NaN. NaN is stored as null.
double number(const Json& json) {
  return json.is_null() ? std::numeric_limits<double>::quiet_NaN() : json.get<double>();
}

Json toJson(const MapScore& s) {
  return {{"truths", s.truths},
          {"reported", s.reported},
          {"found", s.found},
          {"paired", s.paired},
          {"x_m", s.x_m},
          {"y_m", s.y_m},
          {"distances_m", s.distances_m},
          {"iou", s.iou}};
}

MapScore mapScore(const Json& json) {
  const auto count = [&](const char* key) { return json.at(key).get<int>(); };
  return {count("truths"),
          count("reported"),
          count("found"),
          count("paired"),
          number(json.at("x_m")),
          number(json.at("y_m")),
          number(json.at("distances_m")),
          number(json.at("iou"))};
}

Json toJson(const PathScore& s) {
  return {{"poses", s.poses},
          {"x_m", s.x_m},
          {"y_m", s.y_m},
          {"distance_m", s.distance_m},
          {"heading_rad", s.heading_rad}};
}

PathScore pathScore(const Json& json) {
  return {json.at("poses").get<int>(), number(json.at("x_m")), number(json.at("y_m")),
          number(json.at("distance_m")), number(json.at("heading_rad"))};
}

template <typename T>
Json table(const std::map<std::string, T>& values) {
  Json json = Json::object();
  for (const auto& [key, value] : values) json[key] = toJson(value);
  return json;
}

}  // namespace

SeedResult SeedResult::load(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error(path + ": cannot be read");
  try {
    const Json json = Json::parse(file);
    SeedResult result;
    result.seed = json.at("seed").get<std::uint32_t>();
    result.settings = json.at("settings").get<std::string>();
    for (const auto& [key, value] : json.at("maps").items()) result.maps[key] = mapScore(value);
    for (const Json& team : json.at("teams")) {
      result.teams.push_back(
          {team.at("method").get<std::string>(), team.at("robots").get<int>(), mapScore(team.at("map"))});
    }
    for (const auto& [key, value] : json.at("paths").items()) result.paths[key] = pathScore(value);
    for (const auto& [key, value] : json.at("paths_ceiling").items())
      result.paths_ceiling[key] = pathScore(value);
    for (const auto& [key, value] : json.at("robots_f1").items()) result.robots_f1[key] = number(value);
    return result;
  } catch (const Json::exception& error) {
    throw std::runtime_error(path + ": " + error.what());
  }
}

void SeedResult::save(const std::string& path) const {
  Json json{{"format", "omnifleet-choi-seed"}, {"version", 1}, {"seed", seed}, {"settings", settings}};
  json["maps"] = table(maps);
  json["teams"] = Json::array();
  for (const TeamScore& team : teams)
    json["teams"].push_back({{"method", team.method}, {"robots", team.robots}, {"map", toJson(team.map)}});
  json["paths"] = table(paths);
  json["paths_ceiling"] = table(paths_ceiling);
  json["robots_f1"] = Json::object();
  for (const auto& [key, value] : robots_f1) json["robots_f1"][key] = value;
  dataset::writeAtomic(path, json.dump(2) + "\n");
}

}  // namespace omnifleet::choi
