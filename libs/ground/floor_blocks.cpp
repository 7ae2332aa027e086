#include "ground/floor_blocks.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::ground {

namespace {

/// Rounds the height up to whole strips of kCell rows.
cv::Size wholeStrips(const cv::Size& size) {
  constexpr int kRows = FloorView::kCell;
  return {size.width, (size.height + kRows - 1) / kRows * kRows};
}

}  // namespace

FloorBlocks::FloorBlocks(const lens::Camera& camera, const FloorView& view, cv::Size size, int block_cells)
    : block_px_(block_cells * FloorView::kCell),
      floor_m_(size, 0.0f),
      sectors_(size, std::uint8_t{0}),
      marked_px_(wholeStrips(size)),
      bits_(marked_px_),
      area_(marked_px_) {
  for (int row = 0; row * FloorView::kCell < size.height; ++row) all_.push_back({row, 0, size.width});
  area_.cover(all_);
  const Eigen::Vector2d foot = camera.foot();
  const auto foot_px = camera.pixelFromPoint({foot.x(), foot.y(), 0.0});
  if (!foot_px) return;
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const Eigen::Vector2d pixel = Eigen::Vector2d(x + 0.5, y + 0.5) * block_px_ - Eigen::Vector2d(0.5, 0.5);
      const auto floor = camera.floorFromPixel(pixel);
      const cv::Rect cells(x * block_cells, y * block_cells, block_cells, block_cells);
      if (!floor || cv::countNonZero(view.coverage()(cells) == 2) < cells.area()) continue;
      const Eigen::Vector2d outward = pixel - *foot_px;
      const double turns = std::atan2(outward.y(), outward.x()) / (2.0 * M_PI) + 0.5;
      floor_m_(y, x) = static_cast<float>((*floor - foot).norm());
      sectors_(y, x) = static_cast<std::uint8_t>(std::min(kSectors - 1, static_cast<int>(turns * kSectors)));
    }
  }
}

const std::vector<Blob>& FloorBlocks::regions(const cv::Mat1b& marks) {
  bits_.clear();
  pack(all_, marks, bits_);
  return labeller_.label(bits_, area_, 1);
}

FloorBlocks::Lengths FloorBlocks::lengthsOf(const Blob& region, const cv::Mat1b& marks,
                                            std::uint8_t mark) const {
  Lengths farthest_m{};
  for (const Run& run : region.runs) {
    for (int x = run.begin; x < run.end; ++x) {
      if (marks(run.row, x) != mark) continue;
      float& m = farthest_m[sectors_(run.row, x)];
      m = std::max(m, floor_m_(run.row, x));
    }
  }
  return farthest_m;
}

double FloorBlocks::lengthOf(const Lengths& farthest_m) {
  double length_m = 0.0;
  for (const float m : farthest_m) length_m += m * 2.0 * M_PI / kSectors;
  return length_m;
}

}  // namespace omnifleet::ground
