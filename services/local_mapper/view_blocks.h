#pragma once

#include <algorithm>
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "ground/floor_view.h"
#include "lens/camera.h"

namespace omnifleet::local_mapper {

/// The view in blocks of the image, about 40 per row. Occlusions are detected from their mean colours.
class ViewBlocks {
 public:
  using Means = std::vector<cv::Vec3f>;  ///< per block, grey levels (grey image: three equal channels)

  /// The camera is kept by reference.
  ViewBlocks(const lens::Camera& camera, const ground::FloorView& view);

  /// @param image of the view's size, BGR8 or grey; nine samples per block are read
  void read(const cv::Mat& image);
  /// The frame read last has no predecessor.
  void forgetBefore() { frames_ = 1; }
  const Means& means() const { return means_; }
  /// Of the previous frame; meaningless until hasBefore().
  const Means& before() const { return before_; }
  bool hasBefore() const { return frames_ > 1; }

  cv::Size image() const { return image_; }
  cv::Size grid() const { return grid_; }
  std::size_t count() const { return static_cast<std::size_t>(grid_.area()); }
  int side_px() const { return side_px_; }
  /// Blocks that lie wholly in the view, in order.
  const std::vector<int>& inView() const { return in_view_; }
  /// Blocks of inView() at the outer edge of the view.
  const std::vector<int>& rim() const { return rim_; }

  bool isInView(int block) const { return is_in_view_[static_cast<std::size_t>(block)] != 0; }

  /// A saturated colour shows neither hue nor structure.
  static bool isSaturated(const cv::Vec3f& a) { return std::max({a[0], a[1], a[2]}) > 245.0f; }
  /// Greatest difference over the channels, grey levels.
  static float difference(const cv::Vec3f& a, const cv::Vec3f& b);
  /// Difference between the directions of the colours, 0–1. Light and shadow do not change it. 0 where one is
  /// nearly black.
  static float hueDifference(const cv::Vec3f& a, const cv::Vec3f& b);
  static constexpr float kAnotherHue = 0.08f;  ///< of hueDifference()
  /// Does a block's colour differ by more than `levels`, or its hue, from all that `then` shows there and up
  /// to two blocks around? Something that moved slightly in between does not differ.
  bool differs(int block, const Means& then, float levels) const;
  /// Correlation of the logarithms of brightness, now and then, −1 to 1. A change of light does not affect
  /// it.
  /// @param turned_rad rotation of the robot since then, counter-clockwise
  /// @return none where `then` shows hardly any structure
  std::optional<double> correlation(const std::vector<int>& blocks, const Means& then,
                                    double turned_rad = 0.0) const;

 private:
  void findRim();
  int turned(int block, double angle_rad) const;

  const lens::Camera& camera_;
  cv::Size image_, grid_;
  int side_px_;
  std::vector<int> in_view_, rim_;
  std::vector<std::uint8_t> is_in_view_;  ///< per block
  Means means_, before_;
  int frames_ = 0;  ///< number of frames read, counted up to 2
};

}  // namespace omnifleet::local_mapper
