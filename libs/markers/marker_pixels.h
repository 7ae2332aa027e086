#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "geometry/pose2.h"
#include "lens/camera.h"
#include "markers/colour_table.h"
#include "markers/layout.h"
#include "markers/plane_window.h"
#include "markers/tone.h"

namespace omnifleet::markers {

/// BGR of a luma and two chroma channels, grey levels (ITU-R BT.601). JPEG and video files store the chroma
/// with half the resolution, so luma and chroma have different blurs.
Eigen::Vector3d bgrFrom(const Eigen::Vector3d& luma_chroma);

/// The pixels of one marker and around it, prepared for a fit at an approximate pose. Buffers are kept from
/// marker to marker.
class MarkerPixels {
 public:
  /// Pixels of a region that are farther than the blur from every edge. They measure its colour only.
  struct Deep {
    int count = 0;
    Eigen::Vector3d sum{0.0, 0.0, 0.0};
    double squares = 0.0;
    int misfits = 0;  ///< pixels of another colour, not in the sums
  };

  MarkerPixels(const lens::Camera& camera, double height_m, const Layout& layout, const ColourTable& table);

  /// Collects the pixels whose colour a blur of this σ can mix. False if less than a quarter of the marker is
  /// inside the image. With a tone, colours are light in place of grey levels.
  bool collect(const cv::Mat& bgr, const Pattern& pattern, const Pose2& map_from_base, double blur_px,
               const Tone* tone = nullptr);

  Eigen::Index count() const { return count_; }
  const Eigen::ArrayXf& u() const { return u_; }  ///< in base_link at the approximate pose, m
  const Eigen::ArrayXf& v() const { return v_; }
  const Eigen::ArrayXXf& colour() const { return colour_; }      ///< luma and chroma
  const Eigen::ArrayXXf& surround() const { return surround_; }  ///< colour of the surroundings nearby
  const std::vector<Deep>& deep() const { return deep_; }
  /// First estimate of the colour of each region.
  const std::vector<Eigen::Vector3d>& regionColours() const { return region_colours_; }
  double metresPerPx() const { return metres_per_px_; }
  /// Motion in base_link (at the approximate pose) per pixel.
  const Eigen::Matrix2d& scale() const { return plane_.scale(); }
  double visibleShare() const { return visible_share_; }

 private:
  /// Values of all pixels of the window, row by row.
  struct Planes {
    std::vector<float> u, v;        ///< in base_link, m
    std::vector<float> outside_px;  ///< distance from the outline, negative inside
    std::vector<float> edge_px;     ///< distance to the nearest edge of a rectangle
    std::vector<float> region;      ///< topmost rectangle, −1: none
    std::vector<float> luma, cb, cr;
    std::vector<float> blue, green, red;  ///< of one row

    void resize(const cv::Rect& window);
    Eigen::Vector3f colour(std::size_t i) const { return {luma[i], cb[i], cr[i]}; }
  };

  cv::Rect windowAround(const Pose2& map_from_base, cv::Size image) const;
  void fillPlanes(const cv::Mat& bgr, const cv::Rect& window, const Tone* tone);
  void measureRegions(const cv::Mat& bgr, const cv::Rect& window, const Pattern& pattern);
  void sumSurroundings(const cv::Rect& window);
  Eigen::Vector3f surroundAt(int x, int y) const;
  void addPixels(const cv::Rect& window);
  void addDeep(std::size_t region, const Eigen::Vector3f& colour);

  lens::Camera camera_;
  double height_m_;
  const Layout& layout_;
  const ColourTable& table_;
  PlaneWindow plane_;
  double metres_per_px_ = 0.0, visible_share_ = 0.0;
  float reach_px_ = 0.0F, deep_px_ = 0.0F;
  int width_ = 0, height_ = 0;  ///< of the window
  Planes planes_;
  std::vector<std::array<float, 4>> sums_;  ///< integral image of weight and weighted colours of surroundings
  Eigen::Vector3f mean_surround_{0.0F, 0.0F, 0.0F};
  Eigen::Index count_ = 0;
  Eigen::ArrayXf u_, v_;
  Eigen::ArrayXXf colour_, surround_;
  std::vector<Deep> deep_;
  std::vector<Eigen::Vector3d> region_colours_;
};

}  // namespace omnifleet::markers
