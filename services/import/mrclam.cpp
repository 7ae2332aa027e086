#include "import/mrclam.h"

#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

#include "dataset/csv.h"
#include "dataset/writer.h"

extern char** environ;

namespace omnifleet::import {
namespace {

namespace fs = std::filesystem;
using Fields = std::vector<std::string_view>;

fs::path folderOf(const std::string& source) {
  if (!fs::is_directory(source))
    throw options::Error(source + ": no such folder; give the folder or .tar.gz of the data set");
  if (fs::exists(fs::path(source) / "Barcodes.dat")) return source;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(source)) {
    if (entry.path().filename() == "Barcodes.dat") return entry.path().parent_path();
  }
  throw options::Error(source + ": contains no Barcodes.dat, so it is not an MRCLAM data set");
}

/// A row with a time and numbers.
struct Row {
  TimeNs time_ns = 0;
  std::vector<double> values;
};

std::vector<Row> readTimed(const fs::path& path, std::size_t columns, std::vector<std::string>& warnings) {
  std::vector<Row> rows;
  dataset::readRows(path.string(), ' ', warnings, [&](const Fields& fields) -> std::string {
    Row row;
    row.values.resize(columns);
    bool good = fields.size() == columns + 1 && dataset::parseSeconds(fields[0], row.time_ns);
    for (std::size_t i = 0; good && i < columns; ++i)
      good = dataset::parseNumber(fields[i + 1], row.values[i]);
    if (!good) return fmt::format("expected a time and {} numbers", columns);
    rows.push_back(std::move(row));
    return {};
  });
  return rows;
}

std::map<int, std::vector<double>> readSubjects(const fs::path& path, std::size_t columns,
                                                std::vector<std::string>& warnings) {
  std::map<int, std::vector<double>> subjects;
  dataset::readRows(path.string(), ' ', warnings, [&](const Fields& fields) -> std::string {
    std::vector<double> numbers(columns + 1);
    bool good = fields.size() > columns;
    for (std::size_t i = 0; good && i <= columns; ++i) good = dataset::parseNumber(fields[i], numbers[i]);
    if (!good) return fmt::format("expected a subject and {} numbers", columns);
    subjects[static_cast<int>(numbers[0])] = {numbers.begin() + 1, numbers.end()};
    return {};
  });
  return subjects;
}

class Importer {
 public:
  Importer(const std::string& source, std::string out, const MrclamOptions& options)
      : folder_(folderOf(source)), out_(std::move(out)), options_(options) {}

  MrclamReport run() {
    const auto barcodes = readSubjects(folder_ / "Barcodes.dat", 1, report_.warnings);
    landmarks_ = readSubjects(folder_ / "Landmark_Groundtruth.dat", 2, report_.warnings);
    for (const auto& [subject, values] : barcodes) subject_of_[static_cast<int>(values[0])] = subject;
    std::vector<dataset::RobotRecording> robots;
    for (const auto& [subject, barcode] : barcodes) {
      if (isRobot(subject)) robots.push_back(robot(subject));
    }
    if (robots.empty())
      throw options::Error(folder_.string() +
                           ": contains no Robot<n>_Odometry.dat of a subject in Barcodes.dat");
    report_.robots = static_cast<int>(robots.size());
    report_.landmarks = static_cast<int>(landmarks_.size());
    dataset::writeDatasetYaml(out_, robots);
    writeLandmarks();
    return report_;
  }

 private:
  bool isRobot(int subject) const {
    return fs::exists(folder_ / fmt::format("Robot{}_Odometry.dat", subject));
  }

  dataset::RobotRecording robot(int subject) {
    dataset::RobotRecording robot;
    robot.name = fmt::format("r{}", subject);
    robot.body = {options_.robot_radius_m, {}, options_.robot_height_m, options_.wheel_separation_m};
    const TimeNs first_ns = writeWheels(subject, robot.name);
    writeObservations(subject, robot.name);
    const std::vector<dataset::StampedPose> truth = writeTruth(subject, robot.name);
    if (!options_.initial_poses) return robot;
    for (const auto& pose : truth) {
      if (pose.time_ns <= first_ns || !robot.initial_pose) robot.initial_pose = pose.map_from_base;
    }
    return robot;
  }

  /// @return time of the first row
  TimeNs writeWheels(int subject, const std::string& name) {
    dataset::WheelsWriter writer(out_, name);
    TimeNs first_ns = INT64_MAX, last_ns = INT64_MIN;
    for (const Row& row :
         readTimed(folder_ / fmt::format("Robot{}_Odometry.dat", subject), 2, report_.warnings)) {
      if (row.time_ns <= last_ns) continue;  // two rows within one millisecond, the resolution of the log
      const double half_turn_mps = 0.5 * row.values[1] * options_.wheel_separation_m;
      writer.write({row.time_ns, row.values[0] - half_turn_mps, row.values[0] + half_turn_mps});
      last_ns = row.time_ns;
      first_ns = std::min(first_ns, row.time_ns);
      ++report_.odometry_rows;
    }
    return first_ns;
  }

  void writeObservations(int subject, const std::string& name) {
    dataset::ObservationsWriter writer(out_, name);
    for (const Row& row :
         readTimed(folder_ / fmt::format("Robot{}_Measurement.dat", subject), 3, report_.warnings)) {
      const int barcode = static_cast<int>(row.values[0]);
      const auto seen = subject_of_.find(barcode);
      std::string id = fmt::format("barcode{}", barcode);
      if (seen == subject_of_.end()) {
        ++report_.unknown_barcodes;
      } else {
        id = isRobot(seen->second) ? fmt::format("r{}", seen->second) : std::to_string(seen->second);
      }
      writer.write({row.time_ns, id, row.values[1], row.values[2]});
      ++report_.observations;
    }
  }

  std::vector<dataset::StampedPose> writeTruth(int subject, const std::string& name) {
    const fs::path path = folder_ / fmt::format("Robot{}_Groundtruth.dat", subject);
    std::vector<dataset::StampedPose> poses;
    if (!fs::exists(path)) return poses;
    for (const Row& row : readTimed(path, 3, report_.warnings)) {
      poses.push_back({row.time_ns, {row.values[0], row.values[1], wrapAngle(row.values[2])}});
    }
    dataset::writeTruthTrajectory(out_, name, poses);
    return poses;
  }

  void writeLandmarks() {
    constexpr int kVertices = 24;
    std::vector<dataset::MapObject> scene;
    std::vector<dataset::Landmark> survey;
    for (const auto& [subject, place] : landmarks_) {
      dataset::MapObject object;
      object.id = static_cast<std::uint64_t>(subject);
      object.name = std::to_string(subject);
      object.centroid_m = {place[0], place[1]};
      for (int k = 0; k < kVertices; ++k) {
        const double phi = 2.0 * M_PI * k / kVertices;
        object.outline_m.emplace_back(object.centroid_m + options_.landmark_radius_m *
                                                              Eigen::Vector2d(std::cos(phi), std::sin(phi)));
      }
      survey.push_back({object.name, object.centroid_m, 0.005});
      scene.push_back(std::move(object));
    }
    dataset::writeTruthScene(out_, scene);
    std::filesystem::remove(out_ + "/landmarks.yaml");  // of an earlier import
    if (options_.survey) dataset::writeLandmarks(out_ + "/landmarks.yaml", survey);
  }

  fs::path folder_;
  std::string out_;
  MrclamOptions options_;
  MrclamReport report_;
  std::map<int, int> subject_of_;  ///< key: barcode
  std::map<int, std::vector<double>> landmarks_;
};

}  // namespace

MrclamReport importMrclam(const std::string& source, const std::string& out, const MrclamOptions& options) {
  return Importer(source, out, options).run();
}

void unpack(const std::string& archive, const std::string& folder) {
  std::string tar = "tar", flags = "-xzf", to = "-C", from = archive, into = folder;
  char* const argv[] = {tar.data(), flags.data(), from.data(), to.data(), into.data(), nullptr};
  pid_t child = 0;
  int how = 0;
  if (posix_spawnp(&child, "tar", nullptr, nullptr, argv, environ) != 0 || waitpid(child, &how, 0) != child ||
      !WIFEXITED(how) || WEXITSTATUS(how) != 0) {
    throw options::Error(archive + ": tar failed to unpack it; check that it is a complete .tar.gz");
  }
}

}  // namespace omnifleet::import
