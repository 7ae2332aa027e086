#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "tests/raycast/arena_view.h"

namespace omnifleet::raycast {

/// Renders an arena for one camera. Pixels that show one surface have two samples, all others
/// ArenaCamera::kSamples² samples. Images are linear (B, G, R) until they are developed.
class ArenaRenderer {
 public:
  ArenaRenderer(const ArenaScene& scene, const lens::CameraModel& camera) : scene_(&scene), camera_(camera) {}

  /// Image of the camera of a robot at `map_from_base`. `moving` are all moving robots; the camera does not
  /// show the box with index `own` among them, only its shadow.
  cv::Mat3f fromRobot(const Pose2& map_from_base, const std::vector<ArenaBox>& moving, int own) const;

  /// Image of a fixed camera. The arena without moving robots is rendered once.
  cv::Mat3f fixed(const std::vector<ArenaBox>& moving);

 private:
  using Tiles = std::vector<char>;
  /// What the middle of each pixel shows. Without `only`: of all tiles.
  void findSurfaces(const ArenaView& view, const Tiles* only, cv::Mat1i& keys) const;
  void shade(const ArenaView& view, const Tiles* only, const cv::Mat1i& keys, cv::Mat3f& image) const;
  template <typename Visit>
  void forPixels(const Tiles* only, const Visit& visit) const;

  const ArenaScene* scene_;
  ArenaCamera camera_;
  cv::Mat1i background_keys_;
  cv::Mat3f background_;
};

/// Image with the tone curve of sRGB, vignetting and noise (σ in grey levels). `frame` selects the noise.
cv::Mat3b developed(const cv::Mat3f& linear, double light, double noise, unsigned seed, unsigned frame);

}  // namespace omnifleet::raycast
