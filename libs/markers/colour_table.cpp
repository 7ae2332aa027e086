#include "markers/colour_table.h"

#include <Eigen/Core>
#include <algorithm>

namespace omnifleet::markers {
namespace {

Eigen::Vector3d chroma(const Eigen::Vector3d& rgb) {
  return rgb / std::max(1.0, rgb.maxCoeff());
}

}  // namespace

ColourTable::ColourTable(const std::vector<dataset::Rgb>& colours, const ColourOptions& options)
    : colours_(colours.size()) {
  std::vector<Eigen::Vector3d> wanted;
  for (const auto& c : colours) wanted.push_back(chroma({1.0 * c[0], 1.0 * c[1], 1.0 * c[2]}));
  for (int index = 0; index < 32768; ++index) {
    // Middle of the step of 8 grey levels.
    const Eigen::Vector3d rgb(8.0 * (index & 31) + 3.5, 8.0 * ((index >> 5) & 31) + 3.5,
                              8.0 * (index >> 10) + 3.5);
    if (rgb.maxCoeff() < options.min_brightness) continue;
    if (1.0 - rgb.minCoeff() / rgb.maxCoeff() < options.min_saturation) continue;
    double nearest = options.chroma_tolerance;
    for (std::size_t i = 0; i < wanted.size(); ++i) {
      const double distance = (chroma(rgb) - wanted[i]).norm();
      if (distance > nearest) continue;
      nearest = distance;
      table_[static_cast<std::size_t>(index)] = static_cast<std::uint8_t>(i + 1);
    }
  }
}

}  // namespace omnifleet::markers
