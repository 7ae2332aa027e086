// Prints the errors of the local mapper's support functions against the truth of a rendered data set, by
// distance. Usage: local_mapper_accuracy DATASET [OPTIONS.yaml] [DEBUG_FOLDER]

#include <chrono>
#include <cstdio>
#include <map>

#include "dataset/frame_source.h"
#include "local_mapper/debug_images.h"
#include "local_mapper/local_mapper.h"
#include "tests/unit/services/local_mapper/silhouette_truth.h"

namespace {

using namespace omnifleet;
using namespace omnifleet::local_mapper::testing;

struct Sums {
  int n = 0;
  double px = 0, px2 = 0, m = 0, m2 = 0;
  void add(const SupportError& e) {
    ++n;
    px += e.pixels;
    px2 += e.pixels * e.pixels;
    m += e.metres;
    m2 += e.metres * e.metres;
  }
  void print(const char* name) const {
    if (n == 0) return;
    const double mean_px = px / n, mean_m = m / n;
    std::printf("%-22s n %6d  bias %+6.3f px  spread %5.3f px   bias %+6.2f cm  spread %5.2f cm\n", name, n,
                mean_px, std::sqrt(px2 / n - mean_px * mean_px), 100 * mean_m,
                100 * std::sqrt(m2 / n - mean_m * mean_m));
  }
};

/// Signed distance of a contour pixel from the true outline in the image, positive outside.
double edgeDistance(const TrueObject& object, const Eigen::Vector2f& at, const lens::Camera& camera) {
  const Eigen::Vector2d p = at.cast<double>();
  double best = 1e9;
  const std::size_t n = object.silhouette_m.size();
  for (std::size_t i = 0; i < n; ++i) {
    for (int k = 0; k < 20; ++k) {  // straight edges on the floor are curves in the image
      const auto point = [&](double share) {
        const Eigen::Vector2d x =
            object.silhouette_m[i] + share * (object.silhouette_m[(i + 1) % n] - object.silhouette_m[i]);
        return camera.pixelFromPoint({x.x(), x.y(), 0.0}).value_or(Eigen::Vector2d(1e6, 1e6));
      };
      const Eigen::Vector2d a = point(k / 20.0), edge = point((k + 1) / 20.0) - a;
      const double share = std::min(1.0, std::max(0.0, (p - a).dot(edge) / edge.squaredNorm()));
      best = std::min(best, (p - a - share * edge).norm());
    }
  }
  const auto floor = camera.floorFromPixel(p);
  return floor && contains(object.silhouette_m, *floor) ? -best : best;
}

struct Totals {
  int missed = 0, merged = 0, extra = 0, frames = 0, height_n = 0;
  double height_error = 0, milliseconds = 0;
  std::map<std::string, Sums> sums;
};

void run(const dataset::Dataset& data, const dataset::GroundTruth& truth,
         const dataset::RobotRecording& robot, const local_mapper::Options& options, const std::string& debug,
         Totals& totals) {
  const lens::Camera camera(robot.fisheye->camera);
  local_mapper::LocalMapper mapper(camera, options);
  const auto frames = dataset::openStream(*robot.fisheye, dataset::Colour::kBgr);
  local_mapper::Frame frame;
  dataset::FrameInfo info;
  Pose2 previous;
  bool has_previous = false;
  while (frames->next(frame.image, info)) {
    frame.acquired_ns = info.time_ns;
    frame.sequence = info.sequence;
    frame.state = info.state;
    const Pose2 pose = truePose(truth, robot.name, info.time_ns);
    Motion motion;
    motion.valid = has_previous;
    motion.previous_from_current = has_previous ? previous.inverse() * pose : Pose2{};
    const auto begun = std::chrono::steady_clock::now();
    const LocalMap& map = mapper.process(frame, motion);
    totals.milliseconds +=
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begun).count();
    previous = pose;
    has_previous = true;
    ++totals.frames;
    if (!debug.empty())
      local_mapper::DebugImages::render(mapper, map, frame.image)
          .save(debug + "/" + robot.name + "_" + std::to_string(info.sequence));
    const auto objects = trueObjects(data, truth, robot.name, info.time_ns, camera);
    const auto matches = match(objects, map.objects);
    std::vector<int> uses(map.objects.size(), 0);
    for (const int m : matches)
      if (m >= 0) ++uses[static_cast<std::size_t>(m)];
    for (std::size_t i = 0; i < uses.size(); ++i) {
      if (uses[i] > 0) continue;
      ++totals.extra;
      std::printf("%s frame %u: false object %d at %.2f %.2f\n", robot.name.c_str(), info.sequence,
                  map.objects[i].label, map.objects[i].contact_m.x(), map.objects[i].contact_m.y());
    }
    for (std::size_t i = 0; i < objects.size(); ++i) {
      if (objects[i].contact_m > 2.0) continue;
      if (matches[i] < 0) {
        ++totals.missed;
        std::printf("%s frame %u: missed %s at %.2f m\n", robot.name.c_str(), info.sequence,
                    objects[i].name.c_str(), objects[i].contact_m);
        continue;
      }
      const auto& seen = map.objects[static_cast<std::size_t>(matches[i])];
      if (uses[static_cast<std::size_t>(matches[i])] > 1 || seen.solidity < 0.94) {
        ++totals.merged;
        std::printf("%s frame %u: merged %s at %.2f m, solidity %.3f\n", robot.name.c_str(), info.sequence,
                    objects[i].name.c_str(), objects[i].contact_m, seen.solidity);
        continue;
      }
      for (const auto& p : mapper.floorContours()[static_cast<std::size_t>(matches[i])].pixels)
        totals.sums[objects[i].name + " edge"].add({0.0, edgeDistance(objects[i], p, camera), false});
      char bin[64];
      for (const auto& e : supportErrors(objects[i], seen, camera)) {
        std::snprintf(bin, sizeof bin, "%.1f m %s", 0.4 * std::floor(objects[i].contact_m / 0.4),
                      e.far_side ? "top" : "contact");
        totals.sums[bin].add(e);
        totals.sums[e.far_side ? "all top" : "all contact"].add(e);
        totals.sums[objects[i].name].add(e);
        if (std::abs(e.pixels) > 3)
          std::printf("%s frame %u: %s at %.2f m off by %.1f px (%s, truncated %d)\n", robot.name.c_str(),
                      info.sequence, objects[i].name.c_str(), objects[i].contact_m, e.pixels,
                      e.far_side ? "top" : "contact", seen.truncated);
      }
      if (seen.height_sigma_m > 0 && !objects[i].is_robot) {
        ++totals.height_n;
        totals.height_error += std::abs(seen.height_m - objects[i].height_m);
      }
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) return 2;
  const auto data = dataset::Dataset::open(argv[1]);
  const auto truth = dataset::GroundTruth::load(argv[1]);
  local_mapper::Options options;
  if (argc > 2 && argv[2][0] != '-') options = local_mapper::Options::read(options::Section::load(argv[2]));
  setvbuf(stdout, nullptr, _IOLBF, 0);
  Totals totals;
  for (const auto& robot : data.robots)
    if (robot.fisheye) run(data, truth, robot, options, argc > 3 ? argv[3] : "", totals);
  for (const auto& [name, sums] : totals.sums) sums.print(name.c_str());
  std::printf("%d frames, missed %d, merged %d, false %d, height error %.1f mm (%d), %.2f ms a frame\n",
              totals.frames, totals.missed, totals.merged, totals.extra,
              1000 * totals.height_error / std::max(1, totals.height_n), totals.height_n,
              totals.milliseconds / std::max(1, totals.frames));
  return 0;
}
