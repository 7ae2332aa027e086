#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "geometry/pose2.h"
#include "observation/observation.h"

namespace omnifleet::estimation {

/// How what a robot's wheels tell has to be read.
enum class Wiring : std::size_t { kAsConfigured, kReversed, kSwapped, kBoth, kLeftReversed, kRightReversed };
inline constexpr std::size_t kWirings = 6;

/// Something that may stand still, as it is seen.
struct Standing {
  Eigen::Vector2d in_base_m;
  double half_width_m;
};

/// Holds the way that wheels tell, and the ways that they would tell with wrong signs or the wheels swapped,
/// against what is seen before and after each stretch of it. Asks nothing of poses, nor of who tracks things
/// by the same wheels: the nearest of about the same width is the same thing.
class WheelTrial {
 public:
  /// A frame; `motion`: from the one before.
  void add(const Motion& motion, double wheel_separation_m, std::vector<Standing> seen);
  /// Nothing was seen, or the wheels have not measured the whole way.
  void interrupt() { then_.clear(); }

  /// Other than kAsConfigured where stretch after stretch contradicts the wheels as configured and confirms
  /// that out.
  Wiring verdict() const;

 private:
  void begin(std::vector<Standing> seen);
  void judge(const std::vector<Standing>& now);

  std::vector<Standing> then_;         ///< where the stretch began; empty: there is none
  std::array<Pose2, kWirings> way_{};  ///< since
  double rolled_m_ = 0.0;              ///< mean of both wheels
  std::array<double, kWirings> misfit_{};
  double stretches_ = 0.0;  ///< that misfit_ is the sum of; what is long ago counts less
};

}  // namespace omnifleet::estimation
