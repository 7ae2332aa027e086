// evaluate OUT DATASET: compares a run with the truth of its recording. The only program that reads
// groundtruth/.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <stdexcept>
#include <string>

#include "dataset/atomic_file.h"
#include "evaluate/report.h"
#include "options/range_check.h"

int main(int argc, char** argv) {
  constexpr int kOk = 0, kFailed = 1, kBadInput = 2;
  CLI::App app(
      "Compares a run with the truth of its recording: prints a table, writes OUT/metrics.json.\n"
      "Exit code: 0 done, 1 a result of the run is missing or damaged or cannot be written, 2 invalid "
      "input.");
  std::string out, recording, align = "none";
  app.add_option("OUT", out, "run directory (its --out)")->required()->check(omnifleet::options::notEmpty());
  app.add_option("DATASET", recording, "recording with groundtruth/")
      ->required()
      ->check(omnifleet::options::notEmpty());
  app.add_option(
         "--align", align,
         "none, or fleet: first align the whole run to the truth (for a run with an arbitrary map frame)")
      ->check(CLI::IsMember({"none", "fleet"}))
      ->default_val("none");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kOk : kBadInput;
  }
  try {
    const omnifleet::evaluate::Report report = omnifleet::evaluate::evaluateRun(
        out, recording,
        align == "fleet" ? omnifleet::evaluate::Frame::kFree : omnifleet::evaluate::Frame::kSame);
    omnifleet::dataset::writeAtomic(out + "/metrics.json", omnifleet::evaluate::metricsJson(report));
    if (std::fputs(omnifleet::evaluate::table(report).c_str(), stdout) < 0 || std::fflush(stdout) != 0)
      throw std::runtime_error("cannot write the table to the standard output");
    return kOk;
  } catch (const omnifleet::options::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kBadInput;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kFailed;
  }
}
