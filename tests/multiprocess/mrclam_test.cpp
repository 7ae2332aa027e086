// Real robots and external data (MRCLAM, Leung et al., IJRR 2011): imported, replayed by processes and by one
// process with identical results, evaluated against motion capture. OMNIFLEET_MRCLAM_S: number of seconds to
// use; default 140, until all robots are localized; 0: all, in the slow set.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/multiprocess/process.h"
#include "tests/test_data.h"

namespace omnifleet::test {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

constexpr auto kPatience = 3000s;  // for the whole replay, on a busy machine

double secondsUsed() {
  const char* text = std::getenv("OMNIFLEET_MRCLAM_S");
  return text != nullptr ? std::atof(text) : 140.0;
}

/// Time in the first field of a row (seconds or nanoseconds), in seconds; 0 for a comment.
double secondsOf(const std::string& row) {
  const double number = std::strtod(row.c_str(), nullptr);
  return number > 1e15 ? 1e-9 * number : number;
}

void cutFile(const fs::path& path, double until_s) {
  std::istringstream all(fileText(path.string()));
  std::ofstream kept(path);
  for (std::string row; std::getline(all, row);) {
    if (secondsOf(row) <= until_s) kept << row << '\n';
  }
}

/// Keeps only the first seconds of a dataset, counted from the first row of any robot's wheels.
void cut(const std::string& dataset, double seconds) {
  double first_s = 1e300;
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(dataset)) {
    const std::string extension = entry.path().extension().string();
    if (extension == ".csv" || extension == ".tum") files.push_back(entry.path());
    if (entry.path().filename() != "data.csv") continue;
    std::ifstream rows(entry.path());
    std::string row;
    std::getline(rows, row);
    if (std::getline(rows, row)) first_s = std::min(first_s, secondsOf(row));
  }
  for (const fs::path& file : files) cutFile(file, first_s + seconds);
}

std::string imported(const std::string& name, const std::vector<std::string>& flags) {
  const std::string out = freshDir(name);
  std::vector<std::string> command{program("import_mrclam"), dataPath("mrclam/MRCLAM_Dataset7.tar.gz"),
                                   out + "/data"};
  command.insert(command.end(), flags.begin(), flags.end());
  Process import(command, out + "/import.log");
  EXPECT_EQ(import.wait(120s), std::optional<int>(0)) << import.output();
  EXPECT_THAT(import.output(), testing::HasSubstr("5 robots, 15 landmarks"));
  if (secondsUsed() > 0) cut(out + "/data", secondsUsed());
  return out;
}

std::map<std::string, std::string> resultsOf(const std::string& out) {
  std::map<std::string, std::string> files;
  for (const char* part : {"objects.geojson", "map.bt", "map.pgm", "map.yaml"})
    files[part] = fileText(out + "/" + part);
  for (const char* folder : {"/trajectories/", "/covariances/", "/localization/"}) {
    for (const auto& entry : fs::directory_iterator(out + folder))
      files[folder + entry.path().filename().string()] = fileText(entry.path().string());
  }
  return files;
}

nlohmann::json evaluated(const std::string& folder, const std::string& out,
                         const std::vector<std::string>& align) {
  std::vector<std::string> command{program("evaluate"), out, folder + "/data"};
  command.insert(command.end(), align.begin(), align.end());
  Process evaluate(command, folder + "/evaluate.log");
  EXPECT_EQ(evaluate.wait(60s), std::optional<int>(0)) << evaluate.output();
  std::printf("%s\n", evaluate.output().c_str());
  return nlohmann::json::parse(fileText(out + "/metrics.json"));
}

/// Replays by processes and in one process, expects identical results. @return metrics of the processes' run
nlohmann::json replayed(const std::string& folder, int domain, const std::vector<std::string>& align) {
  const std::string data = folder + "/data", out = folder + "/processes", one = folder + "/in_process";
  const fs::path build = fs::path(program("launch")).parent_path().parent_path();
  Process replay({"/bin/bash", sourceDir() + "/scripts/replay.sh", data, "--out", out, "--domain",
                  std::to_string(domain)},
                 folder + "/replay.log", {{"OMNIFLEET_BUILD_DIR", build.string()}});
  EXPECT_EQ(replay.wait(kPatience), std::optional<int>(0)) << replay.output();
  Process alone({program("fleet_in_process"), "--dataset", data, "--out", one}, folder + "/in_process.log");
  EXPECT_EQ(alone.wait(kPatience), std::optional<int>(0)) << alone.output();
  const auto by_processes = resultsOf(out), in_process = resultsOf(one);
  EXPECT_EQ(by_processes.size(), 19u);
  for (const auto& [file, bytes] : by_processes) {
    EXPECT_FALSE(bytes.empty()) << file;
    EXPECT_TRUE(in_process.at(file) == bytes) << file << " differs between processes and one process";
  }
  return evaluated(folder, out, align);
}

/// The same run with other rounding: without fused multiply-add.
nlohmann::json withOtherRounding(const std::string& folder, const std::vector<std::string>& align) {
  const std::string out = folder + "/rounded";
  Process alone({program("fleet_in_process"), "--dataset", folder + "/data", "--out", out},
                folder + "/rounded.log", {{"GLIBC_TUNABLES", "glibc.cpu.hwcaps=-FMA,-FMA4,-AVX2"}});
  EXPECT_EQ(alone.wait(kPatience), std::optional<int>(0)) << alone.output();
  return evaluated(folder, out, align);
}

double deadReckoning(const nlohmann::json& metrics) {
  double sum_m = 0.0;
  for (const auto& path : metrics["paths"]) sum_m += path["dead_reckoning"]["distance_m"].get<double>();
  return sum_m / static_cast<double>(metrics["paths"].size());
}

void expectAllRobots(const nlohmann::json& metrics) {
  ASSERT_EQ(metrics["paths"].size(), 5u);
  for (const auto& [name, path] : metrics["paths"].items()) EXPECT_GT(path["poses"], 0) << name;
}

/// The NEES of all poses: not over-confident and not too conservative. Measured: 2.3 to 2.5 in the first
/// minutes, 2.8 to 3.7 for the whole data set, depending on rounding.
void expectConsistent(const nlohmann::json& metrics) {
  const double nees = metrics["paths_mean"]["consistency"]["nees_mean"];
  EXPECT_LE(nees, secondsUsed() > 0 ? 3.4 : 4.2);
  EXPECT_GE(nees, 1.0);
}

TEST(Mrclam, LocalizesWithin10cmBySurveyedLandmarks) {
  OMNIFLEET_NEEDS_DATA(archive, "mrclam/MRCLAM_Dataset7.tar.gz");
  const auto metrics = replayed(imported("mrclam_surveyed", {"--survey"}), 86, {});
  expectAllRobots(metrics);
  const double mean_m = metrics["paths_mean"]["distance_m"], wheels_m = deadReckoning(metrics);
  std::printf("mean %.3f m, wheels alone %.3f m\n", mean_m, wheels_m);
  EXPECT_LE(mean_m, 0.10);
  EXPECT_LT(mean_m, wheels_m);
  // The consistent value is 3. The true heading of one robot wanders by 1.5° relative to its own course
  // (docs/methods/evaluation.md).
  expectConsistent(metrics);
  EXPECT_LE(metrics["landmarks"]["mean_m"], 0.02);  // surveyed to 5 mm, so they must not move
}

TEST(Mrclam, LocalizesWithin15cmByUnknownLandmarks) {
  OMNIFLEET_NEEDS_DATA(archive, "mrclam/MRCLAM_Dataset7.tar.gz");
  const std::string folder = imported("mrclam_unknown", {});
  const auto metrics = replayed(folder, 87, {"--align", "fleet"});
  expectAllRobots(metrics);
  const double mean_m = metrics["paths_mean"]["distance_m"], wheels_m = deadReckoning(metrics);
  std::printf("mean %.3f m, wheels alone %.3f m\n", mean_m, wheels_m);
  EXPECT_LE(mean_m, 0.15);
  EXPECT_LT(mean_m, wheels_m);
  // Each pose is compared in the datum of its covariance: first the initial pose, later the landmarks. The
  // rounding error of stiff steps once acted as measurements. Single robots then turned away within these
  // first minutes (NEES 7.6, or 5.4 with the other rounding).
  const auto other = withOtherRounding(folder, {"--align", "fleet"});
  for (const auto* each : {&metrics, &other}) {
    EXPECT_LE((*each)["paths_mean"]["distance_m"], 0.15);
    expectConsistent(*each);
    for (const auto& [name, path] : (*each)["paths"].items())
      EXPECT_LE(path["consistency"]["nees_mean"], secondsUsed() > 0 ? 4.5 : 6.5) << name;
  }
  // After two minutes some landmarks have been observed only once or twice.
  EXPECT_LE(metrics["landmarks"]["mean_m"], secondsUsed() > 0 ? 0.30 : 0.20);
}

}  // namespace
}  // namespace omnifleet::test
