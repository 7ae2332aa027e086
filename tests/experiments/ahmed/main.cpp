// Experiments of Ahmed et al. 2013. `scale` measures the pairs of Table 1. `rows` prints the figures of a
// seed, `report` the table of all seeds, `figures` draws the figures. scripts/experiments/ahmed.sh makes
// recordings and runs.

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>

#include "dataset/atomic_file.h"
#include "options/options.h"
#include "options/range_check.h"
#include "tests/experiments/ahmed/error_curve.h"
#include "tests/experiments/ahmed/figures.h"
#include "tests/experiments/ahmed/result.h"
#include "tests/experiments/ahmed/scale_pairs.h"

namespace {

using namespace omnifleet::ahmed;
namespace fs = std::filesystem;

std::string seedFolder(const std::string& out, std::uint32_t seed) {
  return out + "/seed_" + std::to_string(seed);
}

void printReport(const std::string& out, std::uint32_t first, std::uint32_t last) {
  std::vector<SeedFigures> seeds;
  std::string all = heading();
  for (std::uint32_t seed = first; seed <= last; ++seed) {
    SeedFigures figures = SeedFigures::load(out, seed);
    all += rows(figures);
    if (!figures.runs.empty()) seeds.push_back(std::move(figures));
  }
  const std::string text = report(seeds);
  std::fputs(text.c_str(), stdout);
  omnifleet::dataset::writeAtomic(out + "/table.txt", text + "\n" + all);
}

/// Fig. 3a/b is drawn by fit_scale; Figs. 2 and 4 are those of ceiling_view.
void drawFigures(const std::string& out, std::uint32_t first, std::uint32_t last,
                 const std::vector<std::string>& overlays) {
  const std::string folder = out + "/figures";
  omnifleet::dataset::makeDirectories(folder);
  std::vector<std::string> recordings;
  for (std::uint32_t seed = first; seed <= last; ++seed) {
    const std::string at = seedFolder(out, seed), run = at + "/omnifleet";
    if (!fs::exists(at + "/literal/map.yaml") || !fs::exists(run + "/map.yaml")) continue;
    recordings.push_back(at + "/recording");
    if (recordings.size() == 1) {
      drawDistanceVector(recordings.front(), overlays, folder + "/fig1_distance_vector.png");
      const std::string ceiling = run + "/ceiling/";
      if (fs::exists(ceiling + "c1_tracking.png") && fs::exists(ceiling + "c2_tracking.png"))
        drawBeside({{"left ceiling camera", ceiling + "c1_tracking.png"},
                    {"right ceiling camera", ceiling + "c2_tracking.png"}},
                   folder + "/fig2_tracking.png");
      if (fs::exists(ceiling + "c1_map.png"))
        drawBeside({{"map in the left ceiling camera", ceiling + "c1_map.png"},
                    {"map in the right ceiling camera", ceiling + "c2_map.png"}},
                   folder + "/fig4_map.png");
    }
    if (recordings.size() <= 2)
      drawMaps(recordings.back(), {{"literal", at + "/literal"}, {"omnifleet", run}},
               folder + (recordings.size() == 1 ? "/fig5_maps.png" : "/fig6_maps.png"));
  }
  if (recordings.empty()) throw std::runtime_error(out + ": no seed is finished");
  const ErrorCurve curve = errorCurve(recordings, overlays);
  omnifleet::dataset::writeAtomic(folder + "/error_over_distance.csv", curve.csv());
  drawErrorCurve(curve, folder + "/error_over_distance.png");
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("The experiments of Ahmed et al. 2013 in simulated arenas");
  app.require_subcommand(1);
  std::string out;
  std::uint32_t seed = 0, first = 1000, last = 1009;
  std::vector<std::string> overlays;
  auto* scale =
      app.add_subcommand("scale",
                         "render the ten experiments of Table 1 and measure their pairs; prints the "
                         "metres of floor per pixel of the ceiling camera");
  auto* row = app.add_subcommand("rows", "print the figures of one seed");
  auto* all = app.add_subcommand("report", "print the table of all finished seeds");
  auto* figures = app.add_subcommand("figures", "draw the figures");
  auto* head = app.add_subcommand("heading", "print the heading of the rows");
  for (auto* command : {scale, row}) command->add_option("--seed", seed, "seed")->required();
  for (auto* command : {all, figures}) {
    command->add_option("--first", first, "first seed");
    command->add_option("--last", last, "last seed");
  }
  figures->add_option("--config", overlays, "overlay of the literal method, repeatable")->required();
  for (auto* command : {scale, row, all, figures})
    command->add_option("--out", out, "folder of the results")
        ->required()
        ->check(omnifleet::options::notEmpty());
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    if (scale->parsed()) std::printf("%.6f\n", calibrate(seed, out).metres_per_ceiling_px);
    if (head->parsed()) std::fputs(heading().c_str(), stdout);
    if (row->parsed()) std::fputs(rows(SeedFigures::load(out, seed)).c_str(), stdout);
    if (all->parsed()) printReport(out, first, last);
    if (figures->parsed()) drawFigures(out, first, last, overlays);
    return 0;
  } catch (const omnifleet::options::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "ahmed_experiment: %s\n", error.what());
    return 1;
  }
}
