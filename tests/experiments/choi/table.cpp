#include "table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <set>
#include <tuple>

namespace omnifleet::choi {
namespace {

using Value = std::function<double(const SeedResult&)>;

Spread over(const std::vector<SeedResult>& results, const Value& value) {
  std::vector<double> values;
  for (const SeedResult& result : results) values.push_back(value(result));
  return Spread::of(values);
}

template <typename Score>
Value of(const std::map<std::string, Score> SeedResult::*scores, const std::string& key,
         const std::function<double(const Score&)>& part) {
  return [=](const SeedResult& result) {
    const auto found = (result.*scores).find(key);
    return found == (result.*scores).end() ? std::nan("") : part(found->second);
  };
}

Value ofMap(const std::string& key, const std::function<double(const MapScore&)>& part) {
  return of<MapScore>(&SeedResult::maps, key, part);
}
Value ofPath(const std::string& key, const std::function<double(const PathScore&)>& part) {
  return of<PathScore>(&SeedResult::paths, key, part);
}
Value againstCeiling(const std::string& key, const std::function<double(const PathScore&)>& part) {
  return of<PathScore>(&SeedResult::paths_ceiling, key, part);
}

std::string cell(const Spread& spread, int decimals) {
  if (spread.seeds == 0) return fmt::format("{:>8}{:20}", "-", "");
  return fmt::format("{:>8.{}f} {:<19}", spread.mean, decimals,
                     fmt::format("({:.{}f}, {:.{}f}-{:.{}f})", spread.deviation, decimals, spread.least,
                                 decimals, spread.most, decimals));
}

std::string row(const std::string& what, const std::string& paper, const std::vector<SeedResult>& results,
                const Value& literal, const Value& ours, int decimals = 2) {
  return fmt::format("  {:<42} {:>7} {} {}\n", what, paper, cell(over(results, literal), decimals),
                     cell(over(results, ours), decimals));
}

double x(const MapScore& s) {
  return 100.0 * s.x_m;
}
double y(const MapScore& s) {
  return 100.0 * s.y_m;
}
double distances(const MapScore& s) {
  return 100.0 * s.distances_m;
}
double overlap(const MapScore& s) {
  return s.iou;
}
double found(const MapScore& s) {
  return s.truths > 0 ? 100.0 * s.found / s.truths : std::nan("");
}
double paired(const MapScore& s) {
  return s.truths > 0 ? 100.0 * s.paired / s.truths : std::nan("");
}
double surplus(const MapScore& s) {
  return s.told - s.found;
}

std::string mapRows(const std::vector<SeedResult>& results, const std::string& suffix, bool paper) {
  const auto line = [&](const std::string& what, const std::string& printed, double (*part)(const MapScore&),
                        int decimals = 2) {
    return row(what, paper ? printed : "-", results, ofMap("literal" + suffix, part),
               ofMap("ours" + suffix, part), decimals);
  };
  return line("x error of places, cm", "2.23", x) + line("y error of places, cm", "1.49", y) +
         line("error of distances between them, cm", "-", distances) +
         line("overlap of footprints, IoU", "-", overlap) +
         line("of the true ones so paired (0.5 m), %", "-", paired, 0) +
         line("found (15 cm, IoU 0.3), %", "-", found, 0) + line("objects too many", "-", surplus, 1);
}

std::string pathRows(const std::vector<SeedResult>& results, bool ceiling) {
  const auto line = [&](const std::string& what, const std::string& printed,
                        double (*part)(const PathScore&)) {
    return row(what, printed, results, ceiling ? againstCeiling("literal", part) : ofPath("literal", part),
               ceiling ? againstCeiling("ours", part) : ofPath("ours", part));
  };
  return line("x error of paths, cm", ceiling ? "5.65" : "-",
              [](const PathScore& s) { return 100.0 * s.x_m; }) +
         line("y error of paths, cm", ceiling ? "4.50" : "-",
              [](const PathScore& s) { return 100.0 * s.y_m; }) +
         line("distance error, cm", ceiling ? "7.32" : "-",
              [](const PathScore& s) { return 100.0 * s.distance_m; }) +
         line("heading error, deg", "-", [](const PathScore& s) { return kDegrees * s.heading_rad; });
}

std::string teamRows(const std::vector<SeedResult>& results) {
  std::set<int> sizes;
  for (const SeedResult& result : results) {
    for (const TeamScore& team : result.teams) sizes.insert(team.robots);
  }
  std::string text;
  for (const int n : sizes) {
    const auto mean = [n](const std::string& method, double (*part)(const MapScore&)) -> Value {
      return [=](const SeedResult& result) {
        std::vector<double> values;
        for (const TeamScore& team : result.teams) {
          if (team.method == method && team.robots == n) values.push_back(part(team.map));
        }
        return Spread::of(values).mean;
      };
    };
    const auto line = [&](const std::string& what, double (*part)(const MapScore&), int decimals = 2) {
      return row(fmt::format("{} robot{}: {}", n, n == 1 ? "" : "s", what), "-", results,
                 mean("literal", part), mean("ours", part), decimals);
    };
    text += line("x error, cm", x) + line("y error, cm", y) + line("IoU", overlap) +
            line("paired, %", paired, 0) + line("found, %", found, 0);
  }
  return text;
}

std::string tableOne(const std::vector<SeedResult>& results) {
  const auto distance = [](const PathScore& s) { return 100.0 * s.distance_m; };
  std::string text = "Table 1. Comparison of experiment results for global paths: distance error, cm\n";
  const auto line = [&](const std::string& what, const std::string& value) {
    text += fmt::format("  {:<62} {:>8}\n", what, value);
  };
  const auto mean = [&](const Value& value) {
    const Spread spread = over(results, value);
    return spread.seeds > 0 ? fmt::format("{:.2f}", spread.mean) : std::string("-");
  };
  line("the paper's method, as the paper reports it", "7.32");
  line("the paper's method here (literal), against the ceiling tracker",
       mean(againstCeiling("literal", distance)));
  line("ours, against the ceiling tracker", mean(againstCeiling("ours", distance)));
  line("ours, against the exact truth", mean(ofPath("ours", distance)));
  line("wheels alone, exactly integrated, against the exact truth", mean(ofPath("wheels", distance)));
  line("Ladybug camera in 2012 [31], as the paper reports it", "8.51");
  line("spherical image in 2011 [32], likewise", "7.11");
  line("upward camera and CHL map in 2007 [33], likewise", "19.6");
  line("topological navigation in 2007 [34], likewise", "11");
  line("scan matching in 2006 [35], likewise", "10");
  return text;
}

}  // namespace

Spread Spread::of(const std::vector<double>& values) {
  Spread s;
  double sum = 0.0, square = 0.0;
  s.least = std::numeric_limits<double>::infinity();
  s.most = -s.least;
  for (const double v : values) {
    if (!std::isfinite(v)) continue;
    ++s.seeds;
    sum += v;
    square += v * v;
    s.least = std::min(s.least, v);
    s.most = std::max(s.most, v);
  }
  if (s.seeds == 0) {
    s.mean = s.deviation = s.least = s.most = std::nan("");
    return s;
  }
  s.mean = sum / s.seeds;
  s.deviation = s.seeds > 1 ? std::sqrt(std::max(0.0, (square - sum * s.mean) / (s.seeds - 1))) : 0.0;
  return s;
}

std::string report(const std::vector<SeedResult>& results) {
  std::string text = fmt::format(
      "Choi et al. 2014, redone over {} seeds ({} to {}).\n"
      "literal: as printed (config/papers/choi.yaml). Mean over the seeds (standard deviation, "
      "least-most).\n\n",
      results.size(), results.front().seed, results.back().seed);
  const std::string head =
      fmt::format("  {:<42} {:>7} {:>8}{:20} {:>8}\n", "", "paper", "literal", "", "ours");
  text += "V.1 Static: three robots drive 5 cm; places of things within 0.5 m of a true one\n" + head +
          mapRows(results, "", true);
  text +=
      "\nV.1 with the lens that eq. 6-7 describe (orthographic, 180 deg) in the place of the 185 deg one\n" +
      head + mapRows(results, " orthographic", false);
  text += "\nV.2 Dynamic: paths of three robots in formation against the ceiling tracker, as in the paper\n" +
          head + pathRows(results, true);
  text += "\nV.2 against the exact truth\n" + head + pathRows(results, false);
  const auto ceiling = [&](double scale, double PathScore::*part) {
    return over(results, ofPath("ceiling", [=](const PathScore& s) { return scale * (s.*part); }));
  };
  text += fmt::format("  {:<42} {:>7} {:>28} {}\n", "the ceiling tracker itself, cm", "4.16", "",
                      cell(ceiling(100.0, &PathScore::distance_m), 2));
  text += fmt::format("  {:<42} {:>7} {:>28} {}\n", "the ceiling tracker itself, deg", "4.46", "",
                      cell(ceiling(kDegrees, &PathScore::heading_rad), 2));
  text += "\nV.2 The map that the drive leaves\n" + head;
  for (const auto& [what, part, decimals] :
       std::vector<std::tuple<std::string, double (*)(const MapScore&), int>>{
           {"x error of places, cm", x, 2},
           {"y error of places, cm", y, 2},
           {"overlap of footprints, IoU", overlap, 2},
           {"of the true ones so paired (0.5 m), %", paired, 0},
           {"found (15 cm, IoU 0.3), %", found, 0},
           {"objects too many", surplus, 1}})
    text += row(what, "-", results, ofMap("dynamic literal", part), ofMap("dynamic ours", part), decimals);
  text += "\nIV.2 Robots told from obstacles, F1 per object and frame\n" + head;
  for (const std::string where : {"static", "dynamic"}) {
    const auto f1 = [&](const std::string& method) -> Value {
      return of<double>(&SeedResult::robots_f1, where + " " + method, [](const double& v) { return v; });
    };
    text += row(where, "-", results, f1("literal"), f1("ours"), 3);
  }
  text += "\nIV.4 The static map from the views of fewer robots (mean over all such teams)\n" + head +
          teamRows(results);
  return text + "\n" + tableOne(results);
}

std::string summary(const SeedResult& result) {
  const auto cm = [](double m) {
    return std::isfinite(m) ? fmt::format("{:.2f}", 100.0 * m) : std::string("-");
  };
  const auto map = [&](const std::string& key) {
    const auto found_at = result.maps.find(key);
    return found_at == result.maps.end() ? std::string("-")
                                         : cm(found_at->second.x_m) + "/" + cm(found_at->second.y_m);
  };
  const auto path = [&](const std::string& key) {
    const auto found_at = result.paths.find(key);
    return found_at == result.paths.end() ? std::string("-") : cm(found_at->second.distance_m);
  };
  return fmt::format("static x/y {} literal, {} ours; path {} literal, {} ours (cm)", map("literal"),
                     map("ours"), path("literal"), path("ours"));
}

}  // namespace omnifleet::choi
