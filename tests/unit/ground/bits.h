#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "ground/bit_mask.h"

namespace omnifleet::ground::testing {

inline std::vector<Strip> wholeImage(cv::Size size) {
  std::vector<Strip> strips;
  for (int y = 0; y < size.height / FloorView::kCell; ++y) strips.push_back({y, 0, size.width});
  return strips;
}

/// A byte mask as bits, on some of its strips.
struct Bits {
  std::vector<Strip> strips;
  BitArea area;
  BitMask mask;

  Bits(const cv::Mat1b& bytes, const std::vector<Strip>& where)
      : strips(where), area(bytes.size()), mask(bytes.size()) {
    area.cover(strips);
    pack(strips, bytes, mask);
  }
  explicit Bits(const cv::Mat1b& bytes) : Bits(bytes, wholeImage(bytes.size())) {}

  /// 0 or 255 for every pixel of the image.
  static cv::Mat1b bytesOf(const BitMask& mask) {
    cv::Mat1b bytes(mask.image());
    unpack(wholeImage(mask.image()), mask, bytes);
    return bytes;
  }
};

}  // namespace omnifleet::ground::testing
