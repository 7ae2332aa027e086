// The study of Fernández et al. 2011, §V. `pick` makes set 2, `study` sweeps k1, k2 and the step over one
// set, `rows` prints the figures of a seed, `report` the table of all seeds, `figures` draws Figs. 4 to 11
// and the error of the compass over the distance.
// scripts/experiments/fernandez.sh makes recordings and runs.

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>

#include "dataset/atomic_file.h"
#include "options/options.h"
#include "options/range_check.h"
#include "tests/experiments/fernandez/compass_range.h"
#include "tests/experiments/fernandez/figures.h"
#include "tests/experiments/fernandez/pick.h"
#include "tests/experiments/fernandez/result.h"

namespace {

using namespace omnifleet::fernandez;
namespace fs = std::filesystem;

void pick(const std::string& recording, const std::string& out, int images) {
  const Picked picked = pickByDifference(recording, out, images);
  std::printf("%d images, taken at a difference of %.4f\n", picked.images, picked.threshold);
}

void measure(const std::string& recording, const std::string& out, bool timed) {
  const StudyResult result = study(ImageSet::load(recording), timed);
  omnifleet::dataset::writeAtomic(out, result.toJson().dump() + "\n");
}

void printReport(const std::string& out, std::uint32_t first, std::uint32_t last) {
  std::vector<SeedFigures> seeds;
  std::string all = heading();
  for (std::uint32_t seed = first; seed <= last; ++seed) {
    seeds.push_back(SeedFigures::load(out, seed));
    all += rows(seeds.back());
  }
  const std::string text = report(seeds);
  std::fputs(text.c_str(), stdout);
  omnifleet::dataset::writeAtomic(out + "/table.txt", text + all);
}

/// §III.B: error of the visual compass and difference of the signatures over the true distance, pairs of both
/// sets together.
void drawDistances(const std::vector<std::string>& recordings, const std::string& name) {
  const RangeOptions options;
  std::vector<ComparedPair> pairs;
  for (const std::string& recording : recordings) {
    const ImageSet set = ImageSet::load(recording);
    const std::vector<ComparedPair> of_set = comparePairs(set, choosePairs(set, options));
    pairs.insert(pairs.end(), of_set.begin(), of_set.end());
  }
  const std::vector<DistanceBin> bins = binned(pairs, options);
  drawCompassRange(bins, name + ".png");
  omnifleet::dataset::writeAtomic(name + ".csv", toCsv(bins));
}

/// Of the first seed that is finished.
void drawFigures(const std::string& out, std::uint32_t first, std::uint32_t last) {
  const std::string folder = out + "/figures/";
  omnifleet::dataset::makeDirectories(folder);
  for (std::uint32_t seed = first; seed <= last; ++seed) {
    const SeedFigures figures = SeedFigures::load(out, seed);
    if (!figures.sets.at(1).study || !figures.sets.at(2).study) continue;
    std::vector<std::string> recordings;
    for (const auto& [set, of_set] : figures.sets) {
      const std::string& recording = recordings.emplace_back(out + "/seed_" + std::to_string(seed) + "/set" +
                                                             std::to_string(set) + "/recording");
      const auto name = [&](int of_first, const char* what) {
        return folder + "fig" + std::to_string(of_first + set - 1) + "_" + what + ".png";
      };
      drawPath(recording, *of_set.study, set, name(4, "path"));
      drawMaps(*of_set.study, set, name(6, "maps"));
      drawShape(*of_set.study, "literal", set, name(8, "shape_literal"));
      drawShape(*of_set.study, "omnifleet", set, name(8, "shape_omnifleet"));
      drawTime(*of_set.study, set, name(10, "time"));
    }
    drawDistances(recordings, folder + "compass_over_distance");
    return;
  }
  throw std::runtime_error(out + ": no seed is finished");
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("The study of Fernández et al. 2011 in simulated rooms");
  app.require_subcommand(1);
  std::string recording, out;
  std::uint32_t seed = 0, first = 1000, last = 1009;
  int images = 150;
  bool timed = false;
  auto* picks = app.add_subcommand("pick", "take images of a recording by a threshold of their difference");
  auto* studies = app.add_subcommand("study", "sweep k1, k2 and the step over the images of a recording");
  auto* row = app.add_subcommand("rows", "print the figures of one seed");
  auto* all = app.add_subcommand("report", "print the table of all finished seeds");
  auto* figures = app.add_subcommand("figures", "draw the figures");
  auto* head = app.add_subcommand("heading", "print the heading of the rows");
  for (auto* command : {picks, studies})
    command->add_option("--recording", recording, "data set")->required();
  picks->add_option("--images", images, "how many, default 150")->check(CLI::Range(3, 100000));
  studies->add_flag("--timed", timed, "measure the time of the map for every k1 and k2, too");
  row->add_option("--seed", seed, "seed")->required();
  for (auto* command : {all, figures}) {
    command->add_option("--first", first, "first seed");
    command->add_option("--last", last, "last seed");
  }
  for (auto* command : {picks, studies, row, all, figures})
    command
        ->add_option(
            "--out", out,
            "folder of the results->check(omnifleet::options::notEmpty()); of pick: data set; of study: file")
        ->required();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    if (picks->parsed()) pick(recording, out, images);
    if (studies->parsed()) measure(recording, out, timed);
    if (head->parsed()) std::fputs(heading().c_str(), stdout);
    if (row->parsed()) std::fputs(rows(SeedFigures::load(out, seed)).c_str(), stdout);
    if (all->parsed()) printReport(out, first, last);
    if (figures->parsed()) drawFigures(out, first, last);
    return 0;
  } catch (const omnifleet::options::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "fernandez_experiment: %s\n", error.what());
    return 1;
  }
}
