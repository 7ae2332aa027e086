#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/floor_view.h"
#include "ground/horizon.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::local_mapper {

struct FaultOptions {
  double frozen_m =
      0.03;  ///< metres rolled under one and the same picture of things that makes it frozen; 0: off
  double frozen_rad = 0.06;  ///< radians turned, likewise
  double cover_step =
      0.12;  ///< 1, of the floor's colour from one frame to the next …; 0: off, scene cuts too
  static FaultOptions read(const options::Section& section);
};

/// A camera that gives the same picture for ever, with new times. A robot that stands sees the same, and one
/// that drives over a bare floor may, in a recording without noise: only a picture that shows things, and
/// stays exactly the same while the wheels turn, is an old one.
class FreezeCheck {
 public:
  FreezeCheck(const ground::FloorView& view, const FaultOptions& options);

  /// @param means of the picture's cells, by which it is known again; @param wheels since the frame before
  bool isFrozen(const cv::Mat3f& means, const Motion& wheels);
  /// How many things the frame just checked shows.
  void saw(std::size_t objects) { shows_things_ = objects > 0; }

 private:
  std::uint64_t fingerprintOf(const cv::Mat3f& means) const;

  FaultOptions options_;
  std::vector<cv::Range> rows_;  ///< cells looked at
  std::uint64_t fingerprint_ = 0;
  bool shows_things_ = false;  ///< the picture of that fingerprint
  double rolled_m_ = 0.0, turned_rad_ = 0.0;
};

enum class HorizonSight : std::uint8_t {
  kOutOfView,  ///< or less than a quarter of it in view
  kHidden,     ///< what is seen above it goes on below it, wherever both are in view
  kSeen
};
HorizonSight lookAtHorizon(const ground::Horizon* horizon, const cv::Mat3f& cell_means);

/// A lens covered by something of one colour looks like a bare floor. But then all things vanish in the very
/// frame in which the floor changes its colour. It ends when things are seen again or when the floor's colour
/// is back, however far the robot drives: a cover that stays must not clear the map, and another floor shows
/// a thing before long. Where nothing is in view it is the horizon that vanishes. One that is there from the
/// beginning shows no thing and no horizon: what lies above it is the same as below, all around. Where the
/// lens sees no horizon, nothing tells that from a bare floor.
class CoverCheck {
 public:
  explicit CoverCheck(const FaultOptions& options) : options_(options) {}

  /// What a frame that cannot be told to be useless otherwise shows.
  struct Sight {
    std::size_t objects = 0;
    bool walls = false;
    cv::Vec3f floor;  ///< mean colour around the robot
    HorizonSight horizon = HorizonSight::kOutOfView;
  };
  /// Why the camera is covered; empty where it is not.
  const char* faultOf(const Sight& sight, const Motion& wheels);
  /// Metres rolled so far without having seen anything but floor, nor a horizon; 0 since something was seen.
  double bare_m() const { return bare_m_; }

 private:
  bool differs(const cv::Vec3f& floor) const;

  FaultOptions options_;
  std::size_t objects_ = 0;   ///< of the last frame that was not covered
  bool has_seen_ = false;     ///< a thing, at any time
  bool saw_horizon_ = false;  ///< likewise of that frame
  double bare_m_ = 0.0;
  cv::Vec3f floor_{0, 0, 0};
};

}  // namespace omnifleet::local_mapper
