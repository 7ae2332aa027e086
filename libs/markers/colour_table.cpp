#include "markers/colour_table.h"

#include <Eigen/Core>
#include <algorithm>
#include <opencv2/core/hal/intrin.hpp>

namespace omnifleet::markers {
namespace {

Eigen::Vector3d chroma(const Eigen::Vector3d& rgb) {
  return rgb / std::max(1.0, rgb.maxCoeff());
}

}  // namespace

double chromaDistance(const dataset::Rgb& a, const dataset::Rgb& b) {
  return (chroma({1.0 * a[0], 1.0 * a[1], 1.0 * a[2]}) - chroma({1.0 * b[0], 1.0 * b[1], 1.0 * b[2]})).norm();
}

ColourTable::ColourTable(const std::vector<dataset::Rgb>& colours, const ColourOptions& options,
                         const std::vector<ColourPair>& touching)
    : similarity_(colours.size()) {
  std::vector<Eigen::Vector3d> wanted, mixed;
  for (const auto& c : colours) wanted.push_back(chroma({1.0 * c[0], 1.0 * c[1], 1.0 * c[2]}));
  for (const ColourPair& pair : touching) {
    constexpr int kShares = 8;
    for (int k = 1; k < kShares; ++k) {
      Eigen::Vector3d mixture;
      for (std::size_t c = 0; c < 3; ++c)
        mixture[static_cast<Eigen::Index>(c)] =
            (k * colours[pair.one][c] + (kShares - k) * colours[pair.other][c]) / (1.0 * kShares);
      mixed.push_back(chroma(mixture));
    }
  }
  for (int index = 0; index < 32768; ++index) {
    // Centre of the step of 8 grey levels.
    const Eigen::Vector3d rgb(8.0 * (index & 31) + 3.5, 8.0 * ((index >> 5) & 31) + 3.5,
                              8.0 * (index >> 10) + 3.5);
    const auto at = static_cast<std::size_t>(index);
    const Eigen::Vector3d own = chroma(rgb);
    for (std::size_t i = 0; i < wanted.size(); ++i)
      similarity_[i][at] =
          static_cast<std::uint8_t>(255.0 * std::max(0.0, 1.0 - (own - wanted[i]).norm() / kFarChroma));
    if (rgb.maxCoeff() < options.min_brightness) continue;
    if (1.0 - rgb.minCoeff() / rgb.maxCoeff() < options.min_saturation) continue;
    double nearest = options.chroma_tolerance;
    for (std::size_t i = 0; i < wanted.size(); ++i) {
      const double distance = (own - wanted[i]).norm();
      if (distance > nearest) continue;
      nearest = distance;
      table_[at] = static_cast<std::uint8_t>(i + 1);
    }
    if (table_[at] == 0 && std::any_of(mixed.begin(), mixed.end(), [&](const Eigen::Vector3d& m) {
          return (own - m).norm() <= options.chroma_tolerance;
        }))
      table_[at] = kMixture;
    if (table_[at] == 0) continue;
    const auto [darkest, brightest] = std::minmax({index & 31, (index >> 5) & 31, index >> 10});
    least_brightest_ = std::min(least_brightest_, brightest);
    greatest_share_ = std::max(greatest_share_, (kWhole * darkest + brightest - 1) / std::max(1, brightest));
  }
}

int ColourTable::blocksWithout(const std::uint8_t* bgr, int blocks) const {
  const auto share = cv::v_setall_u16(static_cast<std::uint16_t>(greatest_share_)),
             least = cv::v_setall_u16(static_cast<std::uint16_t>(least_brightest_));
  const auto possible = [&](const cv::v_uint16x8& dark, const cv::v_uint16x8& bright) {
    const cv::v_uint16x8 low = cv::v_shr<3>(dark), high = cv::v_shr<3>(bright);
    return (cv::v_mul_wrap(low, cv::v_setall_u16(kWhole)) <= cv::v_mul_wrap(high, share)) & (high >= least);
  };
  for (int k = 0; k < blocks; ++k, bgr += 3 * kBlock) {
    cv::v_uint8x16 blue, green, red;
    cv::v_load_deinterleave(bgr, blue, green, red);
    cv::v_uint16x8 darkest[2], brightest[2];
    cv::v_expand(cv::v_min(cv::v_min(blue, green), red), darkest[0], darkest[1]);
    cv::v_expand(cv::v_max(cv::v_max(blue, green), red), brightest[0], brightest[1]);
    if (cv::v_check_any(possible(darkest[0], brightest[0]) | possible(darkest[1], brightest[1]))) return k;
  }
  return blocks;
}

}  // namespace omnifleet::markers
