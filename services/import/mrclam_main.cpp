// import_mrclam SOURCE OUT: converts a UTIAS MRCLAM data set to a dataset of this project.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <filesystem>

#include "import/mrclam.h"
#include "options/options.h"
#include "options/range_check.h"

namespace {

/// A temporary folder; the destructor removes it.
struct TemporaryFolder {
  TemporaryFolder() {
    std::string pattern = (std::filesystem::temp_directory_path() / "omnifleet_import_XXXXXX").string();
    if (mkdtemp(pattern.data()) == nullptr) throw std::runtime_error(pattern + ": cannot create this folder");
    path = pattern;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path, ignored);
  }
  std::string path;
};

int run(const std::string& source, const std::string& out, const omnifleet::import::MrclamOptions& options) {
  using namespace omnifleet::import;
  MrclamReport report;
  if (std::filesystem::is_regular_file(source)) {
    const TemporaryFolder folder;
    unpack(source, folder.path);
    report = importMrclam(folder.path, out, options);
  } else {
    report = importMrclam(source, out, options);
  }
  for (const std::string& warning : report.warnings) std::fprintf(stderr, "%s\n", warning.c_str());
  std::printf(
      "%s: %d robots, %d landmarks, %zu rows of odometry, %zu observations, %zu of unknown barcodes\n",
      out.c_str(), report.robots, report.landmarks, report.odometry_rows, report.observations,
      report.unknown_barcodes);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Converts a UTIAS MRCLAM data set to a dataset: wheel speeds, observations and truth of every robot.");
  std::string source, out;
  omnifleet::import::MrclamOptions options;
  app.add_option("SOURCE", source, "folder or .tar.gz of the data set")
      ->required()
      ->check(omnifleet::options::notEmpty());
  app.add_option("OUT", out, "dataset folder to create")->required()->check(omnifleet::options::notEmpty());
  app.add_option("--wheel-separation", options.wheel_separation_m, "distance between the wheels, metres")
      ->check(omnifleet::options::within({0.01, 10.0}));
  app.add_flag("--initial-poses", options.initial_poses,
               "write the initial pose of each robot (from the truth)");
  app.add_flag("--survey", options.survey,
               "write the surveyed landmark positions to landmarks.yaml (from the truth)");
  bool force = false;
  app.add_flag("--force", force, "overwrite an existing dataset");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    if (!force && std::filesystem::exists(std::filesystem::path(out) / "dataset.yaml"))
      throw omnifleet::options::Error(out + " already contains a dataset; use --force to overwrite it");
    return run(source, out, options);
  } catch (const omnifleet::options::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "import_mrclam: %s\n", error.what());
    return 1;
  }
}
