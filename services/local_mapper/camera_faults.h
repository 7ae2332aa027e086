#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/floor_view.h"
#include "ground/horizon.h"
#include "observation/error_code.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::local_mapper {

/// Why a frame is rejected; the texts are constants.
struct FrameFault {
  ErrorCode code = ErrorCode::kNone;
  const char* text = "";
};

struct FaultOptions {
  double frozen_m =
      0.03;  ///< metres driven with one unchanged image of objects, from which it counts as frozen; 0: off
  double frozen_rad = 0.06;      ///< radians turned, for the same test
  double occlusion_step = 0.12;  ///< 1, relative change of the floor's colour from one frame to the next; 0:
                                 ///< off (scene cuts, too)
  static FaultOptions read(const options::Section& section);
};

/// Detects a camera that repeats one image with new times. A robot at rest sees the same image, and so may
/// one that drives over a bare floor in a recording without noise. Only an image that shows objects and stays
/// exactly the same while the wheels turn counts as frozen.
class FreezeCheck {
 public:
  FreezeCheck(const ground::FloorView& view, const FaultOptions& options);

  /// @param means of the image's cells, the basis of its fingerprint @param wheels motion since the previous
  /// frame
  bool isFrozen(const cv::Mat3f& means, const Motion& wheels);
  /// Sets the number of objects in the frame just checked.
  void setObjectCount(std::size_t objects) { shows_objects_ = objects > 0; }

 private:
  std::uint64_t fingerprintOf(const cv::Mat3f& means) const;

  FaultOptions options_;
  std::vector<cv::Range> rows_;  ///< range of cells per row for the fingerprint
  std::uint64_t fingerprint_ = 0;
  bool shows_objects_ = false;  ///< in the image of that fingerprint
  double rolled_m_ = 0.0, turned_rad_ = 0.0;
};

enum class HorizonState : std::uint8_t {
  kOutOfView,  ///< or less than a quarter of it in view
  kHidden,     ///< the image is the same above and below it, wherever both are in view
  kVisible
};
HorizonState classifyHorizon(const ground::Horizon* horizon, const cv::Mat3f& cell_means);

/// Detects a lens that is fully occluded by something of one colour. The image then resembles a bare floor,
/// but all objects vanish in the frame in which the floor's colour changes. The occlusion ends when objects
/// are visible again or the former floor colour is back, however far the robot drives: a lasting occlusion
/// must not clear the map, and another floor soon shows an object. Where no object is in view, the horizon
/// vanishes instead. An occlusion from the first frame on shows no object and no horizon: the image is the
/// same above and below it, all around. If the lens does not see the horizon, this case cannot be
/// distinguished from a bare floor.
class OcclusionCheck {
 public:
  explicit OcclusionCheck(const FaultOptions& options) : options_(options) {}

  /// Content of a frame that passed all other checks.
  struct FrameContent {
    std::size_t objects = 0;
    bool walls = false;
    cv::Vec3f floor;  ///< mean colour around the robot
    HorizonState horizon = HorizonState::kOutOfView;
  };
  /// The occlusion that the frame shows; kNone without one.
  FrameFault faultOf(const FrameContent& content, const Motion& wheels);
  /// Metres driven with only floor and no horizon in view. A horizon resets it; once an object or a wall was
  /// visible, it stays 0.
  double bare_m() const { return bare_m_; }

 private:
  bool differs(const cv::Vec3f& floor) const;

  FaultOptions options_;
  std::size_t objects_ = 0;   ///< in the last frame that was not occluded
  bool has_seen_ = false;     ///< an object or a wall, in any frame
  bool had_horizon_ = false;  ///< in the last frame that was not occluded
  double bare_m_ = 0.0;
  cv::Vec3f floor_{0, 0, 0};
};

}  // namespace omnifleet::local_mapper
