#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace omnifleet::ground {

/// Colour histogram of the ground (Choi §III.2: "removes a bottom based on a histogram"): 32 levels per
/// channel, 32 768 bins (grey images use the diagonal), learned from the floor around the robot.
class GroundHistogram {
 public:
  static constexpr int kBins = 32 * 32 * 32;

  GroundHistogram() : count_(kBins, 0), is_ground_(kBins, 0) {}

  void clear();
  void add(std::uint8_t b, std::uint8_t g, std::uint8_t r) { add(binOf(b, g, r)); }
  void add(int bin) {
    if (count_[static_cast<std::size_t>(bin)]++ == 0) used_.push_back(bin);
  }

  /// Marks as ground the fullest bin, every bin connected to it (26 neighbours, bins with ≥ min_share of the
  /// samples), and `grow` further bins around. An object among the samples forms a mode of its own and is
  /// excluded. With all_modes every bin ≥ min_share is ground, as in the paper.
  /// @return share of the samples in ground bins; 0 without samples
  double settle(double min_share, int grow, bool all_modes);

  bool isGround(std::uint8_t b, std::uint8_t g, std::uint8_t r) const { return table()[binOf(b, g, r)] != 0; }
  /// Look-up table indexed by binOf(): 1 for ground.
  const std::uint8_t* table() const { return is_ground_.data(); }
  static int binOf(std::uint8_t b, std::uint8_t g, std::uint8_t r) {
    return (b >> 3) << 10 | (g >> 3) << 5 | r >> 3;
  }

 private:
  void spread(const std::vector<int>& from, int min_count, std::vector<int>& reached);

  std::vector<int> count_;
  std::vector<std::uint8_t> is_ground_;
  std::vector<int> used_, ground_, front_;
};

}  // namespace omnifleet::ground
