#include "ground/hued_cells.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "ground/floor_view.h"
#include "ground/shadow_filter.h"

namespace omnifleet::ground {

namespace {

constexpr int kCell = FloorView::kCell;
constexpr float kSigmas = 1.5f;  // standard deviations of a cell's noise

}  // namespace

HuedCells::HuedCells(cv::Size image)
    : cells_(image.height / kCell, image.width / kCell, std::uint8_t{0}), pixels_(image) {}

void HuedCells::mark(const Frame& frame) {
  cells_ = std::uint8_t{0};
  for (int y = 0; y < cells_.rows; ++y) {
    for (int x = 0; x < cells_.cols; ++x) {
      if (frame.off(y + 1, x + 1) == 0) continue;
      const cv::Vec3f &r = frame.floor(y, x), &p = frame.colours(y, x);
      const float rr = std::max(1.0f, r.dot(r)), gain = std::min(1.0f, p.dot(r) / rr);
      const float limit = frame.tolerance_across * gain + kSigmas * frame.hue_noise / std::sqrt(rr);
      cells_(y, x) = frame.across2(y + 1, x + 1) > limit * limit ? 1 : 0;
    }
  }
  cv::morphologyEx(cells_, cells_, cv::MORPH_CLOSE, cv::Mat());
}

const std::vector<Blob>& HuedCells::find(const Frame& frame, const BitArea& area) {
  mark(frame);
  pixels_.clear();
  for (int y = 0; y < cells_.rows; ++y)
    for (int x = 0; x < cells_.cols; ++x)
      if (cells_(y, x) != 0)
        for (int k = 0; k < kCell; ++k) pixels_.set(y * kCell + k, x * kCell, (x + 1) * kCell);
  return labeller_.label(pixels_, area, ShadowFilter::kMinRegion_px);
}

}  // namespace omnifleet::ground
