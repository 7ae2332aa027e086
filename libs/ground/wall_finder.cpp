#include "ground/wall_finder.h"

#include <algorithm>
#include <cmath>

#include "ground/bit_ops.h"

namespace omnifleet::ground {

namespace {

constexpr int kCell = FloorView::kCell;
constexpr int kSectors = 72;
constexpr double kRimDepression_deg =
    6.0;  // where the view of the floor ends for its horizon, not for the image
constexpr double kWallTexture =
    1.6;                     // times as much as the floor may a wall differ from its colour around: it is
                             // seen under steep angles, from near, and nobody chose it to be plain
constexpr int kEdge_px = 1;  // half as wide as what is mixed of floor and wall where they meet, rounded down

SegmenterOptions wallOptions(SegmenterOptions o) {
  o.method = "local";
  o.shadows = false;
  o.line_width_m = 0.0;
  o.reference.all_modes = true;
  o.reference.tolerance_along *= kWallTexture;
  o.reference.tolerance_across *= kWallTexture;
  return o;
}

}  // namespace

WallOptions WallOptions::read(const options::Section& section) {
  WallOptions o;
  section.read("enabled", o.enabled);
  section.read("min_arc_deg", o.min_arc_deg, {1.0, 360.0});
  section.finish();
  return o;
}

WallFinder::WallFinder(const lens::Camera& camera, const FloorView& floor_view, const WallOptions& options,
                       const SegmenterOptions& ground)
    : options_(options),
      sectors_(floor_view.cells(), std::uint8_t{0}),
      before_(floor_view.imageSize()),
      eroded_(floor_view.imageSize()),
      things_(floor_view.imageSize()) {
  if (options.enabled) view_ = FloorView::upward(camera);
  if (!view_) return;
  const cv::Mat1b& coverage = floor_view.coverage();
  for (int y = 1; y + 1 < coverage.rows; ++y) {
    for (int x = 1; x + 1 < coverage.cols; ++x) {
      if (coverage(y, x) == 0) continue;
      bool edge = coverage(y, x) == 1;
      for (int k = 0; k < 9; ++k) edge = edge || coverage(y + k / 3 - 1, x + k % 3 - 1) == 0;
      const auto ray = camera.rayFromPixel({(x + 0.5) * kCell - 0.5, (y + 0.5) * kCell - 0.5});
      if (!edge || !ray || ray->z() < -std::sin(kRimDepression_deg * M_PI / 180.0)) continue;
      const double turns = std::atan2(ray->y(), ray->x()) / (2.0 * M_PI) + 0.5;
      sectors_(y, x) =
          static_cast<std::uint8_t>(1 + std::min(kSectors - 1, static_cast<int>(turns * kSectors)));
    }
  }
  segmenter_ = std::make_unique<GroundSegmenter>(camera, *view_, wallOptions(ground));
}

bool WallFinder::isWall(const Blob& region) {
  reached_.assign(kSectors + 1, 0);
  for (const Run& run : region.runs) {
    if (run.row / kCell >= sectors_.rows) continue;
    const std::uint8_t* sectors = sectors_.ptr(run.row / kCell);
    const int last = std::min(sectors_.cols - 1, (run.end - 1) / kCell);
    for (int x = run.begin / kCell; x <= last; ++x) reached_[sectors[x]] = 1;
  }
  const auto count = std::count(reached_.begin() + 1, reached_.end(), std::uint8_t{1});
  return 360.0 * static_cast<double>(count) >= options_.min_arc_deg * kSectors;
}

bool WallFinder::find(const cv::Mat& image, const std::vector<Blob>& regions, int min_area_px,
                      GroundSegmenter& floor) {
  walls_.clear();
  if (!segmenter_) return false;
  for (const Blob& region : regions)
    if (isWall(region)) walls_.push_back(&region);
  if (walls_.empty() || !segmenter_->segment(image)) return false;
  const BitArea& area = floor.area();
  clear(area, before_);
  for (const Blob* wall : walls_) {
    for (const Run& run : wall->runs) {
      before_.set(run.row, run.begin, run.end);
      before_.keep(run.row, run.begin, run.end, segmenter_->bits());
    }
  }
  erode(area, kEdge_px, before_, eroded_);
  dilate(area, kEdge_px, eroded_, things_);
  for (const Blob* wall : walls_) floor.keepOf(*wall, things_, kWall);
  for (const Blob& region : regions) {
    if (std::find(walls_.begin(), walls_.end(), &region) != walls_.end()) continue;
    for (const Run& run : region.runs) things_.set(run.row, run.begin, run.end);
  }
  regions_ = &labeller_.label(things_, area, min_area_px);
  return true;
}

}  // namespace omnifleet::ground
