#include "ground/wall_finder.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "ground/bit_ops.h"

namespace omnifleet::ground {

namespace {

constexpr int kCell = FloorView::kCell;
constexpr int kSectors = Horizon::kSectors;
constexpr double kRimDepression_deg =
    6.0;  // depression below which the rim of the floor view is the horizon, not the image border
constexpr double kWallTexture = 1.6;  // multiple of the floor's tolerances: walls are seen at steep angles
                                      // and from near, and are not chosen to be plain
constexpr int kLeastShare = 20;       // a region contains walls if one in this many of its pixels is wall
constexpr int kNear = 3;              // cells around what was reached: growing stops that far before edges
constexpr int kMemory = 100;          // frames for which a room is remembered
constexpr int kEdge_px = 1;           // half the width of mixed pixels between floor and wall, rounded down

// Greatest difference of a wall below the horizon from its colour above it, in brightness and in colour at
// equal brightness, as shares of the brightness. A wall is textured, and these are means of few pixels.
constexpr float kAlikeAlong = 0.15f, kAlikeAcross = 0.04f;

bool isAlike(const cv::Vec3f& p, const cv::Vec3f& r) {
  const float rr = std::max(1.0f, r.dot(r)), gain = p.dot(r) / rr;
  return std::abs(gain - 1.0f) <= kAlikeAlong && p.dot(p) / rr - gain * gain <= kAlikeAcross * kAlikeAcross;
}

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
      kinds_(floor_view.cells(), std::uint8_t{kNeither}),
      foot_(camera, floor_view),
      before_(floor_view.imageSize()),
      eroded_(floor_view.imageSize()),
      objects_(floor_view.imageSize()) {
  queue_.resize(kinds_.total());  // all its memory is touched before the first frame
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
  reached_.assign(Horizon::kSectors + 1, 0);
  for (const Run& run : region.runs) {
    if (run.row / kCell >= sectors_.rows) continue;
    const std::uint8_t* sectors = sectors_.ptr(run.row / kCell);
    const int last = std::min(sectors_.cols - 1, (run.end - 1) / kCell);
    for (int x = run.begin / kCell; x <= last; ++x) reached_[sectors[x]] = 1;
  }
  return isWide(static_cast<int>(std::count(reached_.begin() + 1, reached_.end(), std::uint8_t{1})));
}

/// Counts the sectors that show the same below the horizon as above it, and that the growing of the floor did
/// not reach. Leaves their cells in queue_.
int WallFinder::countWallSectors(const GroundSegmenter& floor) {
  queue_.clear();
  if (floor.horizon() == nullptr) return 0;
  int count = 0;
  for (int sector = 1; sector <= Horizon::kSectors; ++sector) {
    const cv::Vec4f& above = floor.horizon()->colours()[static_cast<std::size_t>(sector)];
    const std::vector<cv::Point>& edge = floor.horizon()->edge(sector);
    const auto isFloor = [&](const cv::Point& cell) { return floor.isGrown(cell.y, cell.x); };
    if (above[0] < 0.0f || std::any_of(edge.begin(), edge.end(), isFloor)) continue;
    const std::size_t before = queue_.size();
    for (const cv::Point& cell : edge)
      if (isAlike(floor.cellMeans()(cell), {above[0], above[1], above[2]})) queue_.push_back(cell);
    count += queue_.size() > before ? 1 : 0;
  }
  return count;
}

/// Finds the sectors where the growing of the floor reached the horizon, and the colour there continues above
/// it.
void WallFinder::findLeaks(const GroundSegmenter& floor) {
  leaked_.fill(0);
  if (floor.horizon() == nullptr) return;
  for (int sector = 1; sector <= Horizon::kSectors; ++sector) {
    const cv::Vec4f& above = floor.horizon()->colours()[static_cast<std::size_t>(sector)];
    if (above[0] < 0.0f) continue;
    const std::vector<cv::Point>& edge = floor.horizon()->edge(sector);
    const bool is_leaked = std::any_of(edge.begin(), edge.end(), [&](const cv::Point& cell) {
      return floor.isGrown(cell.y, cell.x) &&
             isAlike(floor.cellMeans()(cell), {above[0], above[1], above[2]});
    });
    leaked_[static_cast<std::size_t>(sector)] = is_leaked ? 1 : 0;
  }
}

void WallFinder::markFloor(const GroundSegmenter& floor) {
  for (int y = 0; y < kinds_.rows; ++y) {
    for (int x = 0; x < kinds_.cols; ++x) {
      const bool is_behind = foot_.any() && foot_.isBehind({x, y});
      kinds_(y, x) = !floor.isGrown(y, x) ? kNeither : is_behind ? kWallGrown : kFloorGrown;
    }
  }
}

/// Marks cells that are connected to those of queue_ by the growing of the walls and do not belong to the
/// floor.
void WallFinder::growDown(const GroundSegmenter& floor) {
  const auto isWall = [&](const cv::Point& cell) {
    return kinds_(cell) == kNeither && floor.horizon()->sectors()(cell) != 0 &&
           segmenter_->isGrown(cell.y, cell.x);
  };
  std::size_t kept = 0;
  for (const cv::Point& cell : queue_) {
    if (!isWall(cell)) continue;
    kinds_(cell) = kWallGrown;
    queue_[kept++] = cell;
  }
  queue_.resize(kept);
  for (std::size_t next = 0; next < queue_.size(); ++next) {
    for (const cv::Point& step : {cv::Point(1, 0), cv::Point(0, 1), cv::Point(-1, 0), cv::Point(0, -1)}) {
      const cv::Point cell = queue_[next] + step;
      if (!cv::Rect({0, 0}, kinds_.size()).contains(cell) || !isWall(cell)) continue;
      kinds_(cell) = kWallGrown;
      queue_.push_back(cell);
    }
  }
}

/// A part that resembles a wall, but is far from what was followed down from the horizon, is the shadow of an
/// object.
void WallFinder::releaseShadow(GroundSegmenter& floor) {
  if (queue_.empty()) return;
  cv::dilate(kinds_ == kWallGrown, near_, cv::Mat1b::ones(2 * kNear + 1, 2 * kNear + 1));
  BitMask& near = eroded_;
  for (const Blob* wall : walls_) {
    for (const Run& run : wall->runs) {
      near.clear(run.row, run.begin, run.end);
      const std::uint8_t* cells = near_.ptr(std::min(run.row / kCell, near_.rows - 1));
      for (int x = run.begin; x < run.end; ++x) {
        const bool kept = objects_.at(x, run.row) || cells[std::min(x / kCell, near_.cols - 1)] != 0;
        if (kept) near.set(run.row, x, x + 1);
      }
    }
    floor.relabelOutside(*wall, near, kShadow);
  }
}

/// Did the growing of the walls reach part of the region?
bool WallFinder::isGrown(const Blob& region) const {
  int grown = 0;
  for (const Run& run : region.runs) {
    const int row = std::min(run.row / kCell, kinds_.rows - 1);
    for (int x = run.begin; x < run.end; ++x)
      grown += kinds_(row, std::min(x / kCell, kinds_.cols - 1)) == kWallGrown ? 1 : 0;
  }
  return kLeastShare * grown > region.area_px;
}

bool WallFinder::find(const cv::Mat& image, const std::vector<Blob>& regions, int min_area_px,
                      GroundSegmenter& floor) {
  if (!options_.enabled) return false;
  regions_ = &regions;
  const bool high = findHigh(image, regions, min_area_px, floor);
  if (!high && floor.hasLowWalls()) markFloor(floor);
  return high || floor.hasLowWalls();
}

bool WallFinder::findHigh(const cv::Mat& image, const std::vector<Blob>& regions, int min_area_px,
                          GroundSegmenter& floor) {
  walls_.clear();
  foot_.forget();
  if (!segmenter_) return false;
  for (const Blob& region : regions)
    if (isWall(region)) walls_.push_back(&region);
  const bool is_seen = isWide(countWallSectors(floor)) || !walls_.empty();
  known_frames_ = is_seen ? kMemory : std::max(0, known_frames_ - 1);
  if (known_frames_ == 0) return false;
  findLeaks(floor);
  foot_.find(image, floor.objects(), leaked_);
  if ((!is_seen && !foot_.any()) || !segmenter_->segment(image)) return false;
  markFloor(floor);
  growDown(floor);
  for (const Blob& region : regions)
    if (isGrown(region) && !isWall(region)) walls_.push_back(&region);
  const BitArea& area = floor.area();
  for (BitMask* mask : {&before_, &eroded_, &objects_}) mask->clear();  // also read beyond the area
  for (const Blob* wall : walls_) {
    for (const Run& run : wall->runs) {
      before_.set(run.row, run.begin, run.end);
      before_.keep(run.row, run.begin, run.end, segmenter_->bits());
    }
  }
  erode(area, kEdge_px, before_, eroded_);
  dilate(area, kEdge_px, eroded_, objects_);
  for (const Blob* wall : walls_) floor.relabelOutside(*wall, objects_, kWall);
  releaseShadow(floor);
  for (const Blob& region : regions) {
    if (std::find(walls_.begin(), walls_.end(), &region) != walls_.end()) continue;
    for (const Run& run : region.runs) objects_.set(run.row, run.begin, run.end);
  }
  regions_ = &labeller_.label(objects_, area, min_area_px);
  return true;
}

}  // namespace omnifleet::ground
