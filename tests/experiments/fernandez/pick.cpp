#include "tests/experiments/fernandez/pick.h"

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <vector>

#include "appearance/keyframe_policy.h"
#include "dataset/atomic_file.h"
#include "dataset/dataset.h"
#include "tests/experiments/fernandez/image_set.h"

namespace omnifleet::fernandez {
namespace {

namespace fs = std::filesystem;

std::vector<std::uint32_t> taken(const ImageSet& set, double threshold) {
  appearance::KeyframePolicy policy;
  policy.rule = appearance::KeyframeRule::kDifference;
  policy.difference = threshold;
  std::vector<std::uint32_t> rows;
  const SetImage* last = nullptr;
  int images = 0;
  for (const SetImage& image : set.images) {
    ++images;
    if (last && !policy.isKeyframe(images, 0.0, appearance::difference(last->pooled, image.pooled))) continue;
    rows.push_back(image.sequence);
    last = &image;
    images = 0;
  }
  return rows;
}

void copyRows(const std::string& recording, const std::string& out, const std::vector<std::uint32_t>& rows) {
  const dataset::Dataset data = dataset::Dataset::open(recording);
  const dataset::RobotRecording& robot = data.robots.front();
  const fs::path from = fs::path(recording) / robot.fisheye->name, to = fs::path(out) / robot.fisheye->name;
  dataset::makeDirectories(to.string());
  const auto all = fs::copy_options::recursive;
  fs::copy(fs::path(recording) / "dataset.yaml", fs::path(out) / "dataset.yaml");
  fs::copy(fs::path(recording) / "groundtruth", fs::path(out) / "groundtruth", all);
  const fs::path wheels = fs::path(robot.name) / "wheels";
  if (fs::exists(recording / wheels)) fs::copy(recording / wheels, out / wheels, all);
  fs::copy(from / "sensor.yaml", to / "sensor.yaml");
  std::string text = "#timestamp [ns],filename\n";
  for (const std::uint32_t row : rows) {
    const dataset::ImageRow& image = robot.fisheye->rows.at(row);
    const fs::path path = image.path;
    const fs::path within = path.lexically_relative(path.parent_path());
    fs::create_directories(to / path.parent_path().lexically_relative(from));
    fs::copy(path, to / path.lexically_relative(from));
    text += std::to_string(image.time_ns) + "," + within.string() + "\n";
  }
  dataset::writeAtomic((to / "data.csv").string(), text);
}

}  // namespace

Picked pickByDifference(const std::string& recording, const std::string& out, int images) {
  const ImageSet set = ImageSet::load(recording);
  double low = 0.0, high = 2.0;  // bounds of the difference
  Picked best;
  std::vector<std::uint32_t> rows;
  constexpr int kHalvings = 24;
  for (int i = 0; i < kHalvings; ++i) {
    const double threshold = 0.5 * (low + high);
    std::vector<std::uint32_t> at = taken(set, threshold);
    const int count = static_cast<int>(at.size());
    (count > images ? low : high) = threshold;
    if (rows.empty() || std::abs(count - images) < std::abs(best.images - images)) {
      best = {count, threshold};
      rows = std::move(at);
    }
  }
  copyRows(recording, out, rows);
  return best;
}

}  // namespace omnifleet::fernandez
