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

// Widths of the columns: label, paper, mean of a method, its spread.
constexpr int kLabel = 42, kPaper = 7, kMean = 9, kSpread = 19;

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
  if (spread.seeds == 0) return fmt::format("{:>{}} {:{}}", "-", kMean, "", kSpread);
  return fmt::format("{:>{}.{}f} {:<{}}", spread.mean, kMean, decimals,
                     fmt::format("({:.{}f}, {:.{}f}-{:.{}f})", spread.deviation, decimals, spread.min,
                                 decimals, spread.max, decimals),
                     kSpread);
}

std::string row(const std::string& what, const std::string& paper, const std::vector<SeedResult>& results,
                const Value& literal, const Value& omnifleet, int decimals = 2) {
  return fmt::format("  {:<{}} {:>{}} {} {}\n", what, kLabel, paper, kPaper,
                     cell(over(results, literal), decimals), cell(over(results, omnifleet), decimals));
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
double unmatched(const MapScore& s) {
  return s.reported - s.found;
}

std::string mapRows(const std::vector<SeedResult>& results, const std::string& suffix, bool paper) {
  const auto line = [&](const std::string& what, const std::string& printed, double (*part)(const MapScore&),
                        int decimals = 2) {
    return row(what, paper ? printed : "-", results, ofMap("literal" + suffix, part),
               ofMap("omnifleet" + suffix, part), decimals);
  };
  return line("x error of centroids, cm", "2.23", x) + line("y error of centroids, cm", "1.49", y) +
         line("error of distances between centroids, cm", "-", distances) +
         line("overlap of footprints, IoU", "-", overlap) +
         line("true obstacles paired (0.5 m), %", "-", paired, 0) +
         line("true obstacles found (15 cm, IoU 0.3), %", "-", found, 0) +
         line("objects that match no true obstacle", "-", unmatched, 1);
}

std::string pathRows(const std::vector<SeedResult>& results, bool ceiling) {
  const auto line = [&](const std::string& what, const std::string& printed,
                        double (*part)(const PathScore&)) {
    return row(what, printed, results, ceiling ? againstCeiling("literal", part) : ofPath("literal", part),
               ceiling ? againstCeiling("omnifleet", part) : ofPath("omnifleet", part));
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
                 mean("literal", part), mean("omnifleet", part), decimals);
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
    text += fmt::format("  {:<64} {:>8}\n", what, value);
  };
  const auto mean = [&](const Value& value) {
    const Spread spread = over(results, value);
    return spread.seeds > 0 ? fmt::format("{:.2f}", spread.mean) : std::string("-");
  };
  line("Choi et al. 2014, as reported", "7.32");
  line("literal, against the ceiling tracker", mean(againstCeiling("literal", distance)));
  line("omnifleet, against the ceiling tracker", mean(againstCeiling("omnifleet", distance)));
  line("omnifleet, against the exact truth", mean(ofPath("omnifleet", distance)));
  line("wheels only, exact integration, against the exact truth", mean(ofPath("wheels", distance)));
  line("Ladybug camera in 2012 [31], as reported by Choi et al.", "8.51");
  line("spherical image in 2011 [32], as reported by Choi et al.", "7.11");
  line("upward camera, CHL map in 2007 [33], as reported by Choi et al.", "19.6");
  line("topological navigation in 2007 [34], as reported by Choi et al.", "11");
  line("scan matching in 2006 [35], as reported by Choi et al.", "10");
  return text;
}

}  // namespace

Spread Spread::of(const std::vector<double>& values) {
  Spread s;
  double sum = 0.0, square = 0.0;
  s.min = std::numeric_limits<double>::infinity();
  s.max = -s.min;
  for (const double v : values) {
    if (!std::isfinite(v)) continue;
    ++s.seeds;
    sum += v;
    square += v * v;
    s.min = std::min(s.min, v);
    s.max = std::max(s.max, v);
  }
  if (s.seeds == 0) {
    s.mean = s.deviation = s.min = s.max = std::nan("");
    return s;
  }
  s.mean = sum / s.seeds;
  s.deviation = s.seeds > 1 ? std::sqrt(std::max(0.0, (square - sum * s.mean) / (s.seeds - 1))) : 0.0;
  return s;
}

std::string report(const std::vector<SeedResult>& results) {
  std::string text = fmt::format(
      "Choi et al. 2014, repeated over {} seeds ({} to {}).\n"
      "paper: value in the paper. literal: method as printed (config/papers/choi.yaml). omnifleet: default "
      "options.\n"
      "Mean over the seeds (standard deviation, minimum-maximum).\n\n",
      results.size(), results.front().seed, results.back().seed);
  const std::string head = fmt::format("  {:<{}} {:>{}} {:>{}} {:{}} {:>{}}\n", "", kLabel, "paper", kPaper,
                                       "literal", kMean, "", kSpread, "omnifleet", kMean);
  text += "V.1 Static: three robots drive 5 cm. Errors over the objects within 0.5 m of a true obstacle\n" +
          head + mapRows(results, "", true);
  text += "\nV.1 with the lens of eq. 6-7 (orthographic, 180 deg) instead of the lens of 185 deg\n" + head +
          mapRows(results, " orthographic", false);
  text += "\nV.2 Dynamic: paths of three robots in formation, against the ceiling tracker as in the paper\n" +
          head + pathRows(results, true);
  text += "\nV.2 Paths against the exact truth\n" + head + pathRows(results, false);
  const auto ceiling = [&](double scale, double PathScore::*part) {
    return over(results, ofPath("ceiling", [=](const PathScore& s) { return scale * (s.*part); }));
  };
  const auto ceilingRow = [&](const char* what, const char* paper, const Spread& spread) {
    return fmt::format("  {:<{}} {:>{}} {:{}} {}\n", what, kLabel, paper, kPaper, "", kMean + 1 + kSpread,
                       cell(spread, 2));
  };
  text +=
      ceilingRow("distance error of the ceiling tracker, cm", "4.16", ceiling(100.0, &PathScore::distance_m));
  text += ceilingRow("heading error of the ceiling tracker, deg", "4.46",
                     ceiling(kDegrees, &PathScore::heading_rad));
  text += "\nV.2 Map of the drive\n" + head;
  for (const auto& [what, part, decimals] :
       std::vector<std::tuple<std::string, double (*)(const MapScore&), int>>{
           {"x error of centroids, cm", x, 2},
           {"y error of centroids, cm", y, 2},
           {"overlap of footprints, IoU", overlap, 2},
           {"true obstacles paired (0.5 m), %", paired, 0},
           {"true obstacles found (15 cm, IoU 0.3), %", found, 0},
           {"objects that match no true obstacle", unmatched, 1}})
    text +=
        row(what, "-", results, ofMap("dynamic literal", part), ofMap("dynamic omnifleet", part), decimals);
  text += "\nIV.2 Robots distinguished from obstacles, F1 over objects and frames\n" + head;
  for (const std::string where : {"static", "dynamic"}) {
    const auto f1 = [&](const std::string& method) -> Value {
      return of<double>(&SeedResult::robots_f1, where + " " + method, [](const double& v) { return v; });
    };
    text += row(where, "-", results, f1("literal"), f1("omnifleet"), 3);
  }
  text += "\nIV.4 Static map from the views of fewer robots (mean over all teams of that size)\n" + head +
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
  return fmt::format("static x/y {} literal, {} omnifleet; path {} literal, {} omnifleet (cm)",
                     map("literal"), map("omnifleet"), path("literal"), path("omnifleet"));
}

}  // namespace omnifleet::choi
