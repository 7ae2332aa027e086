// Loop closing between single places, on recordings of furnished rooms (raycast_room): recall, false closures
// and errors of the relative pose over seeded pairs of frames.
//   raycast_room OUT SEED --pair same|lookalike|disjoint; raycast_room OUT SEED --loop
//   omnifleet_loops OUT/... [--seed N] [--csv FILE] [--parts]

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "dataset/atomic_file.h"
#include "estimation/relocalizer.h"
#include "options/options.h"
#include "tests/experiments/loops/pairs.h"
#include "tests/experiments/loops/study.h"

namespace {

using namespace omnifleet;

/// Scan matching alone accepts what matches: what relocalization asks of a candidate before it is followed.
estimation::LoopCheckOptions scansAlone() {
  const estimation::RelocalizerOptions relocalizer;
  estimation::LoopCheckOptions options;
  options.min_matched = relocalizer.min_matched;
  options.search = relocalizer.search;
  options.search.min_score = relocalizer.min_score;
  options.most_contradict = options.refused = 1.0;
  options.most_sigma_m = 0.1;
  // No evidence is asked for: the best candidate of the search counts.
  options.surfaces.other_share = options.surfaces.missed_share;
  options.least_evidence = options.rival_evidence = 0.0;
  return options;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Loop closing over pairs of places");
  std::vector<std::string> folders;
  std::uint32_t seed = 1;
  std::string csv, overlay;
  bool parts = false;
  loops::PairCounts counts;
  loops::Surroundings surroundings;
  app.add_option("recordings", folders, "folders of recordings")->required();
  app.add_option("--seed", seed, "of the choice of pairs");
  app.add_option("--per-band", counts.per_band, "close pairs per recording and 0.25 m of distance");
  app.add_option("--far", counts.far, "likewise, more than 2 m apart in one room");
  app.add_option("--lookalike", counts.lookalike, "likewise, of rooms with equal walls");
  app.add_option("--other-room", counts.other_room, "likewise, of other rooms");
  app.add_option("--around", surroundings.reach_m,
                 "m of path around the first place whose scans count; 0: its own");
  app.add_option("--options", overlay, "YAML file with options of LoopCheck");
  app.add_option("--csv", csv, "file for one line per pair");
  app.add_flag("--parts", parts, "also without the compass, and with scans alone");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    estimation::LoopCheckOptions options;
    if (!overlay.empty()) options = estimation::LoopCheckOptions::read(options::Section::load(overlay));
    std::vector<loops::Recording> recordings;
    for (const std::string& folder : folders) recordings.emplace_back(folder);
    const std::vector<loops::Pair> pairs = loops::choosePairs(recordings, counts, seed);
    const loops::Shots shots(recordings, pairs, surroundings);
    const std::vector<loops::Outcome> outcomes = loops::evaluate(pairs, shots, options);
    std::printf("Scans, surfaces and compass\n%s\n", loops::report(outcomes).c_str());
    std::fflush(stdout);
    if (!csv.empty()) dataset::writeAtomic(csv, loops::csv(recordings, outcomes));
    if (parts) {
      std::printf("Scans alone, without surfaces that contradict and without compass\n%s\n",
                  loops::report(loops::evaluate(pairs, shots, scansAlone(), false)).c_str());
      std::printf("Scans and surfaces, without compass\n%s\n",
                  loops::report(loops::evaluate(pairs, shots, options, false)).c_str());
    }
    return std::any_of(outcomes.begin(), outcomes.end(), [](const auto& o) { return o.isFalseClosure(); })
               ? 1
               : 0;
  } catch (const options::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "omnifleet_loops: %s\n", error.what());
    return 2;
  }
}
