#include "synthetic/yaml.h"

#include <cmath>
#include <cstdint>

namespace omnifleet::synthetic {

void readRgb(const options::Section& section, const std::string& key, dataset::Rgb& rgb) {
  if (!section.has(key)) return;
  std::vector<double> values;
  section.read(key, values, options::Range{0, 255});
  if (values.size() != 3) section.fail(key, "expected [red, green, blue], each within [0, 255]");
  for (std::size_t i = 0; i < 3; ++i) rgb[i] = static_cast<std::uint8_t>(std::lround(values[i]));
}

void readPose(const options::Section& section, const std::string& key, Pose2& pose) {
  if (!section.has(key)) return;
  Eigen::Vector3d values;
  section.read(key, values, options::Range{-1e4, 1e4});
  pose = Pose2::fromVector(values);
}

void readRows(const options::Section& section, const std::string& key, std::vector<Eigen::Vector3d>& rows) {
  if (!section.has(key)) return;
  std::vector<double> flat;
  section.read(key, flat, options::Range{-1e4, 1e4});
  if (flat.size() % 3 != 0)
    section.fail(key, "expected rows of three numbers in one list: t, a, b, t, a, b, …");
  rows.clear();
  for (std::size_t i = 0; i + 2 < flat.size(); i += 3) rows.emplace_back(flat[i], flat[i + 1], flat[i + 2]);
}

}  // namespace omnifleet::synthetic
