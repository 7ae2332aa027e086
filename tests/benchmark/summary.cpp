#include "tests/benchmark/summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace omnifleet::bench {
namespace {

/// A row of the table: a counter of a benchmark, the same counter of a peer's benchmark, and the budget.
struct Row {
  const char* title;
  const char* benchmark;
  const char* counter = "p50_ms";
  const char* peer = nullptr;  ///< benchmark of the peer; null: no peer
  const char* peer_title = "";
  double max_value = -1;  ///< largest value; negative: no limit
  double min_ratio = 0;   ///< smallest ratio peer ÷ omnifleet; 0: no limit
};

const Row kRows[] = {
    {"local mapper, typical, p50 ms", "local_mapper/typical", "p50_ms", "local_mapper/typical/naive", "naive",
     5.0, 13.0},
    {"local mapper, typical, p99 ms", "local_mapper/typical", "p99_ms", "local_mapper/typical/naive", "naive",
     8.0},
    {"local mapper, typical, p99 of each frame's median, ms", "local_mapper/typical", "frame_p99_ms", nullptr,
     "", 8.0},
    {"local mapper, cluttered, p50 ms", "local_mapper/cluttered", "p50_ms", "local_mapper/cluttered/naive",
     "naive"},
    {"local mapper, cluttered, p99 ms", "local_mapper/cluttered", "p99_ms", "local_mapper/cluttered/naive",
     "naive", 12.0},
    {"local mapper, cluttered, p99 of each frame's median, ms", "local_mapper/cluttered", "frame_p99_ms",
     nullptr, "", 12.0},
    {"page faults of 390 frames, typical", "local_mapper/typical", "minor_faults", nullptr, "", 0},
    {"heap growth of 390 frames, typical, bytes", "local_mapper/typical", "heap_bytes", nullptr, "", 0},
    {"page faults of 390 frames, cluttered", "local_mapper/cluttered", "minor_faults", nullptr, "", 0},
    {"heap growth of 390 frames, cluttered, bytes", "local_mapper/cluttered", "heap_bytes", nullptr, "", 0},
    {"merging a 360-ray scan, p50 ms", "map/scan", "p50_ms", "map/scan/octomap", "insertPointCloud", 0.25,
     10.0},
    {"merging the last 500 of 2000 scans, p50 ms", "map/scan", "last_quarter_ms", "map/scan/octomap",
     "insertPointCloud", 0.25, 10.0},
    {"visible cells of the map, once per second, p50 ms", "map/visible"},
    {"classifier, one frame, p50 ms", "classifier/frame"},
    {"estimator, three frames, p50 ms", "estimator/frame", "p50_ms", "estimator/frame/batch", "whole batch"},
    {"formation, one frame, p50 ms", "formation/frame"},
    {"colour patches, full, p50 ms", "patches/full", "p50_ms", "patches/hsv", "HSV + inRange", 2.5},
    {"colour patches, tracked, p50 ms", "patches/tracked", "p50_ms", "patches/hsv", "HSV + inRange", 0.6},
    {"distance vector, 320x240, p50 ms", "distance_vector/frame", "p50_ms", "distance_vector/frame/naive",
     "flood fill", 2.0},
    {"page faults of 400 frames, distance vector", "distance_vector/frame", "minor_faults", nullptr, "", 0},
    {"heap growth of 400 frames, distance vector, bytes", "distance_vector/frame", "heap_bytes", nullptr, "", 0},
    {"floor motion, 1280x960, p50 ms", "floor_motion/frame", "p50_ms", "floor_motion/frame/ecc",
     "remap + findTransformECC"},
    {"page faults of 200 frames, floor motion", "floor_motion/frame", "minor_faults", nullptr, "", 0},
    {"heap growth of 200 frames, floor motion, bytes", "floor_motion/frame", "heap_bytes", nullptr, "", 0},
    {"panorama 64x512 of 1280x960, p50 ms", "appearance/unwrap", "p50_ms", nullptr, "", 0.3},
    {"page faults of 400 frames, panorama", "appearance/unwrap", "minor_faults", nullptr, "", 0},
    {"appearance, nearest of 1000 places, p50 ms", "appearance/frame/1000", "p50_ms",
     "appearance/frame/1000/naive", "remap + dft", 0.6},
    {"appearance, nearest of 10000 places, p50 ms", "appearance/frame/10000", "p50_ms",
     "appearance/frame/10000/naive", "remap + dft", 1.2},
    {"lens, points forward, p50 ms", "lens/points", "p50_ms", "lens/remap", "image backward"},
    {"frame of 1.2 MB, live, p50 ms", "frames/1.2MB/live", "p50_ms", "frames/1.2MB/udp", "UDP"},
    {"frame of 1.2 MB, live, p50 ms", "frames/1.2MB/live", "p50_ms", "frames/1.2MB/shm", "shared memory"},
    {"frame of 3.7 MB, live, p50 ms", "frames/3.7MB/live", "p50_ms", "frames/3.7MB/udp", "UDP", 0.3},
    {"frame of 3.7 MB, live, p50 ms", "frames/3.7MB/live", "p50_ms", "frames/3.7MB/shm", "shared memory",
     0.3},
    {"frame of 3.7 MB, live, p99 ms", "frames/3.7MB/live", "p99_ms", "frames/3.7MB/udp", "UDP", 2.0},
    {"frame of 3.7 MB, replay, p50 ms", "frames/3.7MB/replay", "p50_ms", "frames/3.7MB/udp", "UDP", 0.3},
    {"frame of 3.7 MB, replay, p99 ms", "frames/3.7MB/replay", "p99_ms", "frames/3.7MB/udp", "UDP", 2.0},
    {"frame to map change, cameras together, p50 ms", "fleet/frame_to_map", "p50_ms", nullptr, "", 20.0},
    {"frame to map change, cameras together, p99 ms", "fleet/frame_to_map", "p99_ms", nullptr, "", 50.0},
    {"frame to map change, cameras apart, p50 ms", "fleet/frame_to_map/apart", "p50_ms", nullptr, "", 20.0},
    {"frame to map change, cameras apart, p99 ms", "fleet/frame_to_map/apart", "p99_ms", nullptr, "", 50.0},
};

std::string number(double value) {
  if (value == 0 || std::abs(value) >= 10) return fmt::format("{:.0f}", value);
  return std::abs(value) < 0.1 ? fmt::format("{:.4f}", value) : fmt::format("{:.3g}", value);
}

std::string budget(const Row& row) {
  std::string text;
  if (row.max_value >= 0) text = "<= " + number(row.max_value);
  if (row.min_ratio > 0) text += fmt::format("{}{:.0f} x", text.empty() ? ">= " : ", >= ", row.min_ratio);
  return text;
}

}  // namespace

void Summary::ReportRuns(const std::vector<Run>& runs) {
  ConsoleReporter::ReportRuns(runs);
  for (const Run& run : runs) {
    const std::string& name = run.run_name.function_name;
    if (run.error_occurred) {
      errors_.push_back(name + ": " + run.error_message);
      counters_.erase(name);
      continue;
    }
    if (run.run_type != Run::RT_Iteration) continue;
    for (const auto& [key, counter] : run.counters) counters_[name][key].push_back(counter.value);
  }
}

std::optional<double> Summary::counter(const std::string& benchmark, const std::string& name) const {
  const auto run = counters_.find(benchmark);
  if (run == counters_.end()) return std::nullopt;
  const auto found = run->second.find(name);
  if (found == run->second.end()) return std::nullopt;
  std::vector<double> values = found->second;
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

void Summary::printTable(std::FILE* out) const {
  fmt::print(out, "\n{:<56} {:>9} {:>9}  {:<17} {:>7}  {:<16} {}\n", "quantity", "omnifleet", "peer",
             "name of the peer", "ratio", "budget", "met");
  for (const Row& row : kRows) {
    const std::optional<double> value = counter(row.benchmark, row.counter);
    if (!value) continue;
    const std::optional<double> peer = row.peer ? counter(row.peer, row.counter) : std::nullopt;
    const double ratio = peer && *value > 0 ? *peer / *value : 0.0;
    const bool has_budget = row.max_value >= 0 || row.min_ratio > 0;
    const bool met = (row.max_value < 0 || *value <= row.max_value) && (!peer || ratio >= row.min_ratio);
    fmt::print(out, "{:<56} {:>9} {:>9}  {:<17} {:>7}  {:<16} {}\n", row.title, number(*value),
               peer ? number(*peer) : "", row.peer_title, peer ? fmt::format("{:.1f}", ratio) : "",
               budget(row), has_budget ? (met ? "yes" : "NO") : "");
  }
  for (const std::string& error : errors_) fmt::print(out, "FAILED {}\n", error);
}

}  // namespace omnifleet::bench
