// Prints the distances of the local mapper's surface points from the true surfaces of a rendered data set,
// with the motion from the wheels or from the truth. Usage: local_mapper_points DATASET [OPTIONS.yaml]
// [ROWS.csv] [truth]

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <map>

#include "dataset/frame_source.h"
#include "evaluation/solid_metrics.h"
#include "local_mapper/local_mapper.h"
#include "motion/wheel_integrator.h"
#include "tests/unit/services/local_mapper/silhouette_truth.h"

namespace {

using namespace omnifleet;
using namespace omnifleet::local_mapper::testing;

struct Errors {
  std::vector<double> away_m;
  double squares = 0.0;  ///< of distances from the surface over the σ of the points
  void print(const std::string& name) {
    if (away_m.empty()) return;
    std::sort(away_m.begin(), away_m.end());
    const auto at = [&](double share) {
      return 100.0 * away_m[static_cast<std::size_t>(share * static_cast<double>(away_m.size() - 1))];
    };
    const auto far = std::count_if(away_m.begin(), away_m.end(), [](double m) { return m > 0.05; });
    std::printf(
        "%-22s n %6zu  median %5.2f cm  90 %% %5.2f cm  99 %% %6.2f cm  beyond 5 cm %4.1f %%  sigmas %4.2f\n",
        name.c_str(), away_m.size(), at(0.5), at(0.9), at(0.99),
        100.0 * static_cast<double>(far) / static_cast<double>(away_m.size()),
        std::sqrt(squares / static_cast<double>(away_m.size())));
  }
};

struct Totals {
  int frames = 0, vectors = 0, of_robots = 0;
  double milliseconds = 0.0;
  std::map<std::string, Errors> errors;
  std::FILE* rows = nullptr;
};

void judge(const ScenePoint& point, const std::vector<TrueObject>& objects, Totals& totals) {
  const TrueObject* nearest = nullptr;
  double least = 1e9;
  for (const auto& object : objects) {
    const double away =
        evaluation::surfaceDistance(object.floor_m, object.height_m, point.point_m.cast<double>());
    if (std::abs(away) >= std::abs(least)) continue;
    least = away;
    nearest = &object;
  }
  if (nearest == nullptr) return;
  if (nearest->is_robot) {
    ++totals.of_robots;
    return;
  }
  const double range = point.point_m.head<2>().norm(), sigma = point.sigma_m;
  char bin[64];
  std::snprintf(bin, sizeof bin, "range %.1f m", 0.4 * std::floor(range / 0.4));
  char bin_sigma[64];
  std::snprintf(bin_sigma, sizeof bin_sigma, "sigma %2.0f mm", 5.0 * std::floor(200.0 * sigma));
  for (const std::string& name : {std::string(bin), std::string(bin_sigma), std::string("all")}) {
    totals.errors[name].away_m.push_back(std::abs(least));
    totals.errors[name].squares += std::min(25.0, least * least / (sigma * sigma));
  }
  if (totals.rows != nullptr)
    std::fprintf(totals.rows, "%s,%.4f,%.4f,%.4f,%.4f,%.4f\n", nearest->name.c_str(), range, sigma, least,
                 static_cast<double>(point.point_m.z()), nearest->height_m);
}

void run(const dataset::Dataset& data, const dataset::GroundTruth& truth,
         const dataset::RobotRecording& robot, const local_mapper::Options& options, bool by_truth,
         Totals& totals) {
  const lens::Camera camera(robot.fisheye->camera);
  local_mapper::LocalMapper mapper(camera, options);
  motion::WheelIntegrator wheels(robot.body.wheel_separation_m, {});
  for (const auto& row : robot.wheels) wheels.add(row.time_ns, row.left_mps, row.right_mps);
  const auto frames = dataset::openStream(*robot.fisheye, dataset::Colour::kBgr);
  local_mapper::Frame frame;
  dataset::FrameInfo info;
  while (frames->next(frame.image, info)) {
    frame.acquired_ns = info.time_ns;
    frame.sequence = info.sequence;
    frame.state = info.state;
    Motion motion = wheels.motionTo(info.time_ns);
    if (by_truth && motion.valid)
      motion.previous_from_current =
          truePose(truth, robot.name, motion.since_ns).inverse() * truePose(truth, robot.name, info.time_ns);
    const auto begun = std::chrono::steady_clock::now();
    const LocalMap& map = mapper.process(frame, motion);
    totals.milliseconds +=
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begun).count();
    ++totals.frames;
    const auto objects = trueObjects(data, truth, robot.name, info.time_ns, camera);
    for (const auto& object : map.objects) {
      totals.vectors += static_cast<int>(object.vectors.size());
      for (const auto& vector : object.vectors)
        if (vector.point.sigma_m > 0) judge(vector.point, objects, totals);
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) return 2;
  const auto data = dataset::Dataset::open(argv[1]);
  const auto truth = dataset::GroundTruth::load(argv[1]);
  const auto options =
      local_mapper::Options::read(argc > 2 && argv[2][0] != '\0' ? options::Section::load(argv[2])
                                                                 : options::Section::parse("{}", "none"));
  const bool by_truth = argc > 4 && std::string(argv[4]) == "truth";
  Totals totals;
  if (argc > 3 && argv[3][0] != '\0') totals.rows = std::fopen(argv[3], "w");
  for (const auto& robot : data.robots) run(data, truth, robot, options, by_truth, totals);
  for (auto& [name, errors] : totals.errors) errors.print(name);
  std::printf(
      "%d frames, %.1f vectors and %.1f points of obstacles in a frame, %d points at robots, %.2f ms\n",
      totals.frames, static_cast<double>(totals.vectors) / totals.frames,
      static_cast<double>(totals.errors["all"].away_m.size()) / totals.frames, totals.of_robots,
      totals.milliseconds / totals.frames);
  if (totals.rows != nullptr) std::fclose(totals.rows);
  return 0;
}
