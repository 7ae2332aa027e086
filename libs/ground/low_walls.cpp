#include "ground/low_walls.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "ground/bit_ops.h"

namespace omnifleet::ground {

namespace {

constexpr int kCell = FloorView::kCell;
constexpr float kFirst_px = 1.5f,
                kLast_px = 6.0f;       // band inside the far edge, where pixels are no longer mixed
constexpr int kLeastPixels = 8;        // minimum number of edge pixels per sector
constexpr double kMostOfObject = 0.5;  // share of the turn: a convex object spans less
constexpr double kLeastWalls = 0.25;   // share of the turn: minimum of edges of one hue
constexpr float kRing_px = 14.0f;      // distance from the far edge within which a ring lies
constexpr float kLongStrip = 8.0f;     // length ÷ breadth from which a strip is no object
constexpr double kLeastWide_m =
    0.12;  // minimum width of a ring projected to the floor; a narrower one is a line on the floor
constexpr float kLeastRing =
    0.8f;  // share of a bearing's pixels within kRing_px of the far edge, on half of the bearings
constexpr float kLeastFilled =
    0.6f;                      // minimum filled share of a bearing from near to far edge; a grid fills less
constexpr int kSpeck_px = 1;   // half the width of structures that are too thin for an object, rounded down
constexpr int kFringe_px = 4;  // along outlines, where some floor may be visible in front of the wall
// In a pixel mixed of floor and wall the two shares sum up to one, except for the wall's texture.
constexpr float kMixedAlong = 0.25f, kMixedNoise = 3.0f;  // kMixedNoise: grey levels, in addition to kAcross
// Tolerances of walls in brightness (along) and hue (across), as shares of the brightness. kSidesAlong: one
// side of the room against another. kPixelAlong: a pixel against the mean of its edge; kSigmas times the
// spread of the edge is added.
constexpr float kSidesAlong = 0.5f, kAcross = 0.04f, kPixelAlong = 0.1f, kSigmas = 3.0f;

bool isAlike(const cv::Vec3f& p, const cv::Vec3f& r, float along, float across) {
  const float rr = std::max(1.0f, r.dot(r)), gain = p.dot(r) / rr;
  return std::abs(gain - 1.0f) <= along && p.dot(p) / rr - gain * gain <= across * across;
}

constexpr float kOpenEnd =
    -1.0f;  // replaces a distance: the region reaches the end of a view that ends above the horizon

float squared(float v) {
  return v * v;
}

/// Is the colour a mixture of the floor's and the wall's?
bool isMixed(const cv::Vec3f& p, const cv::Vec3f& floor, const cv::Vec3f& wall) {
  constexpr float kLeastApart =
      1e-3f;  // squared sine of the angle between the colours; below it they have one hue
  const float ff = std::max(1.0f, floor.dot(floor)), ww = std::max(1.0f, wall.dot(wall)),
              fw = floor.dot(wall);
  const float apart = ff * ww - fw * fw;
  float of_floor = p.dot(floor) / ff, of_wall = 0.0f;
  if (apart > kLeastApart * ff * ww) {
    of_floor = (p.dot(floor) * ww - p.dot(wall) * fw) / apart;
    of_wall = (p.dot(wall) * ff - p.dot(floor) * fw) / apart;
  }
  const cv::Vec3f left = p - of_floor * floor - of_wall * wall;
  return of_floor >= -kAcross && of_wall >= -kAcross && std::abs(of_floor + of_wall - 1.0f) <= kMixedAlong &&
         left.dot(left) <= squared(kAcross * std::sqrt(p.dot(p)) + kMixedNoise);
}

}  // namespace

LowWalls::LowWalls(const lens::Camera& camera, const FloorView& floor_view)
    : camera_(camera),
      sectors_(floor_view.cells(), std::uint8_t{0}),
      beside_(floor_view.cells(), std::uint8_t{0}),
      view_(&floor_view),
      sees_horizon_(FloorView::upward(camera) != nullptr),
      objects_(floor_view.imageSize()),
      eroded_(floor_view.imageSize()),
      opened_(floor_view.imageSize()),
      gaps_(floor_view.imageSize()) {
  const Eigen::Vector2d foot = camera.foot();
  const Eigen::Vector2d pixel =
      camera.pixelFromPoint({foot.x(), foot.y(), 0.0}).value_or(camera.model().principal_point_px);
  foot_px_ = {static_cast<float>(pixel.x()), static_cast<float>(pixel.y())};
  for (int y = 0; y < sectors_.rows; ++y) {
    for (int x = 0; x < sectors_.cols; ++x) {
      const Eigen::Vector2d to = Eigen::Vector2d((x + 0.5) * kCell - 0.5, (y + 0.5) * kCell - 0.5) - pixel;
      const double turns = std::atan2(to.y(), to.x()) / (2.0 * M_PI) + 0.5;
      sectors_(y, x) = static_cast<std::uint8_t>(std::min(kSectors - 1, static_cast<int>(turns * kSectors)));
    }
  }
}

float LowWalls::radius2(int x, int y) const {
  const cv::Point2f to = cv::Point2f(static_cast<float>(x), static_cast<float>(y)) - foot_px_;
  return to.dot(to);
}

/// Visits (sector, cell, row, begin, end): the region's runs, cut at cell borders.
template <typename Visit>
void LowWalls::forSectors(const Blob& region, Visit visit) const {
  for (const Run& run : region.runs) {
    const int cell_y = std::min(run.row / kCell, sectors_.rows - 1);
    for (int begin = run.begin; begin < run.end;) {
      const cv::Point cell(std::min(begin / kCell, sectors_.cols - 1), cell_y);
      const int end = std::min(run.end, (begin / kCell + 1) * kCell);
      visit(static_cast<std::size_t>(sectors_(cell)), cell, run.row, begin, end);
      begin = end;
    }
  }
}

/// Does the region span more than half of the turn around the camera foot? Sets edges_. A region that begins
/// where the view begins is rejected: it is the robot's own body, for which the mask is too small.
bool LowWalls::isAround(const Blob& region) {
  if (!region.rect.contains(cv::Point(cvRound(foot_px_.x), cvRound(foot_px_.y)))) return false;
  return spansTurn(region, kMostOfObject);
}

/// Does the region span more than `turn` (share of the full turn) around the camera foot? Sets edges_.
bool LowWalls::spansTurn(const Blob& region, double turn) {
  edges_.fill({});
  forSectors(region, [&](std::size_t sector, const cv::Point& /*cell*/, int row, int begin, int end) {
    Edge& edge = edges_[sector];
    for (const int x : {begin, end - 1}) {
      const float far = radius2(x, row);
      if (edge.radius2_px < 0.0f || far < edge.near2_px) {
        edge.near2_px = far;
        edge.near = {x, row};
      }
      if (far <= edge.radius2_px) continue;
      edge.radius2_px = far;
      edge.far = {x, row};
    }
  });
  int seen = 0, own = 0;
  for (Edge& edge : edges_) {
    if (edge.radius2_px < 0.0f) continue;
    ++seen;
    own += view_->nearBorder(static_cast<float>(edge.near.x), static_cast<float>(edge.near.y)) ? 1 : 0;
    const auto u = static_cast<float>(edge.far.x), v = static_cast<float>(edge.far.y);
    if (sees_horizon_ && view_->nearBorder(u, v)) edge.radius2_px = kOpenEnd;
  }
  return seen > turn * kSectors && 2 * own < seen;
}

bool LowWalls::isWide(const Edge& edge) const {
  const auto floorAt = [this](const cv::Point& at) {
    return camera_.floorFromPixel({1.0 * at.x, 1.0 * at.y});
  };
  const auto from = floorAt(edge.near), to = floorAt(edge.far);
  return !from || !to || (*to - *from).norm() >= kLeastWide_m;
}

bool LowWalls::isRing(const Blob& region) const {
  std::array<float, kSectors> all{}, far{};
  forSectors(region, [&](std::size_t sector, const cv::Point& /*cell*/, int row, int begin, int end) {
    const float from =
        squared(std::max(0.0f, std::sqrt(std::max(0.0f, edges_[sector].radius2_px)) - kRing_px));
    for (int x = begin; x < end; ++x) far[sector] += radius2(x, row) >= from ? 1.0f : 0.0f;
    all[sector] += static_cast<float>(end - begin);
  });
  int seen = 0, thin = 0, wide = 0;
  for (std::size_t k = 0; k < kSectors; ++k) {
    if (all[k] <= 0.0f) continue;
    ++seen;
    thin += far[k] >= kLeastRing * all[k] ? 1 : 0;
    wide += isWide(edges_[k]) ? 1 : 0;
  }
  return 2 * thin > seen && 2 * wide > seen;
}

/// Neither a line nor a grid on the floor: on most bearings the region is as wide as a wall's height and
/// filled from its near to its far edge.
bool LowWalls::isFilled(const Blob& region) const {
  std::array<float, kSectors> area{};
  forSectors(region, [&](std::size_t sector, const cv::Point& /*cell*/, int /*row*/, int begin, int end) {
    area[sector] += static_cast<float>(end - begin);
  });
  int seen = 0, filled = 0, wide = 0;
  for (std::size_t k = 0; k < kSectors; ++k) {
    if (area[k] <= 0.0f) continue;
    ++seen;
    wide += isWide(edges_[k]) ? 1 : 0;
    const float far2 = radius2(edges_[k].far.x, edges_[k].far.y);
    const auto all = static_cast<float>(M_PI / kSectors) * (far2 - edges_[k].near2_px);
    filled += area[k] >= kLeastFilled * all ? 1 : 0;
  }
  return 2 * filled > seen && 2 * wide > seen;
}

/// A strip on bearings where the surrounding region has no edge: a side of the walls that is lit like the
/// floor, except in places. No object is so long and thin.
bool LowWalls::isRestOfRing(const Blob& region) const {
  bool is_beside = true;
  forSectors(region, [&](std::size_t sector, const cv::Point& /*cell*/, int /*row*/, int /*begin*/,
                         int /*end*/) { is_beside = is_beside && edges_[sector].count == 0; });
  return is_beside && isStrip(region);
}

bool LowWalls::isStrip(const Blob& region) const {
  std::array<float, kSectors> area{}, far{};
  forSectors(region, [&](std::size_t sector, const cv::Point& /*cell*/, int row, int begin, int end) {
    far[sector] = std::max({far[sector], radius2(begin, row), radius2(end - 1, row)});
    area[sector] += static_cast<float>(end - begin);
  });
  float length_px = 0.0f, area_px = 0.0f;
  for (std::size_t k = 0; k < kSectors; ++k) {
    if (area[k] <= 0.0f) continue;
    const float arc_px = std::sqrt(far[k]) * static_cast<float>(2.0 * M_PI / kSectors);
    if (area[k] > kRing_px * arc_px) return false;
    length_px += arc_px;
    area_px += area[k];
  }
  return length_px * length_px >= kLongStrip * area_px;
}

void LowWalls::readEdges(const cv::Mat& image, const Blob& region) {
  std::array<float, kSectors> from{}, to{}, squares{}, lights{};
  for (std::size_t k = 0; k < kSectors; ++k) {
    const float far = std::sqrt(std::max(0.0f, edges_[k].radius2_px));
    from[k] = squared(std::max(0.0f, far - kLast_px));
    to[k] = squared(std::max(0.0f, far - kFirst_px));
  }
  forSectors(region, [&](std::size_t sector, const cv::Point& /*cell*/, int row, int begin, int end) {
    if (edges_[sector].radius2_px < 0.0f ||
        std::max(radius2(begin, row), radius2(end - 1, row)) < from[sector])
      return;
    for (int x = begin; x < end; ++x) {
      const float r2 = radius2(x, row);
      if (r2 < from[sector] || r2 > to[sector]) continue;
      const cv::Vec3f p = image.at<cv::Vec3b>(row, x);
      edges_[sector].colour += p;
      squares[sector] += p.dot(p);
      lights[sector] += squared(p[0] + p[1] + p[2]);
      ++edges_[sector].count;
    }
  });
  for (std::size_t k = 0; k < kSectors; ++k) {
    Edge& edge = edges_[k];
    if (edge.count < kLeastPixels) continue;
    const auto n = static_cast<float>(edge.count);
    edge.colour /= n;
    const float brightness2 = std::max(1.0f, edge.colour.dot(edge.colour));
    const float light2 = std::max(1.0f, squared(edge.colour[0] + edge.colour[1] + edge.colour[2]));
    const float along2 = std::max(0.0f, lights[k] / n / light2 - 1.0f);
    edge.along = std::sqrt(along2);
    edge.across = std::sqrt(std::max(0.0f, squares[k] / n / brightness2 - 1.0f - along2));
  }
}

/// Finds the hue that most of the edges have. @return false where too few edges have it for walls
bool LowWalls::findHue() {
  const auto isRead = [](const Edge& edge) { return edge.count >= kLeastPixels; };
  std::size_t best = 0;
  int most = 0;
  for (std::size_t k = 0; k < kSectors; ++k) {
    if (!isRead(edges_[k])) continue;
    int like = 0;
    for (const Edge& other : edges_)
      like += isRead(other) && isAlike(other.colour, edges_[k].colour, kSidesAlong, kAcross) ? 1 : 0;
    if (like <= most) continue;
    most = like;
    best = k;
  }
  if (most < kLeastWalls * kSectors) return false;
  const cv::Vec3f hue = edges_[best].colour;
  for (Edge& edge : edges_) edge.is_wall = isRead(edge) && isAlike(edge.colour, hue, kSidesAlong, kAcross);
  const auto middleOf = [&](float Edge::*spread) {
    std::array<float, kSectors> spreads{};
    std::ptrdiff_t walls = 0;
    for (const Edge& edge : edges_)
      if (edge.is_wall) spreads[static_cast<std::size_t>(walls++)] = edge.*spread;
    std::nth_element(spreads.begin(), spreads.begin() + walls / 2, spreads.begin() + walls);
    return spreads[static_cast<std::size_t>(walls / 2)];
  };
  along_ = kPixelAlong + kSigmas * middleOf(&Edge::along);
  across_ = kAcross + kSigmas * middleOf(&Edge::across);
  return true;
}

void LowWalls::findNearest() {
  for (int k = 0; k < kSectors; ++k) {
    const auto at = [&](int step) { return (k + step + kSectors) % kSectors; };
    const auto isWall = [&](int step) { return edges_[static_cast<std::size_t>(at(step))].is_wall; };
    int apart = 0;
    while (!isWall(apart) && !isWall(-apart)) ++apart;
    nearest_[static_cast<std::size_t>(k)] = isWall(apart) ? at(apart) : at(-apart);
  }
}

void LowWalls::markObjects(const cv::Mat& image, const Blob& region) {
  forSectors(region, [&](std::size_t sector, const cv::Point& /*cell*/, int row, int begin, int end) {
    const cv::Vec3f& wall = edges_[static_cast<std::size_t>(nearest_[sector])].colour;
    for (int x = begin; x < end; ++x)
      if (!isAlike(image.at<cv::Vec3b>(row, x), wall, along_, across_)) objects_.set(row, x, x + 1);
  });
}

/// Removes what is thinner than an object, and remains of the floor between an object and the wall.
void LowWalls::cleanObjects(const cv::Mat& image, const Blob& region, const BitArea& area,
                            const cv::Mat3f& floor) {
  takeMedian(area, objects_, opened_);
  regrowCorners(area, objects_, opened_, eroded_);
  std::swap(objects_, eroded_);
  erode(area, kFringe_px, objects_, eroded_);
  forSectors(region, [&](std::size_t sector, const cv::Point& cell, int row, int begin, int end) {
    const cv::Vec3f& wall = edges_[static_cast<std::size_t>(nearest_[sector])].colour;
    for (int x = begin; x < end; ++x) {
      if (!objects_.at(x, row) || eroded_.at(x, row)) continue;
      if (!isMixed(image.at<cv::Vec3b>(row, x), floor(cell), wall)) continue;
      objects_.clear(row, x, x + 1);
      gaps_.set(row, x, x + 1);
    }
  });
  erode(area, kSpeck_px, objects_, eroded_);
  dilate(area, kSpeck_px, eroded_, opened_);
}

bool LowWalls::find(const cv::Mat& image, const std::vector<Blob>& regions, const BitArea& area,
                    const cv::Mat3f& floor, BitMask& objects, bool only_rings) {
  walls_.clear();
  const auto isWalls = [&](const Blob& region) {
    if (!isAround(region) || (only_rings && !isRing(region))) return false;
    readEdges(image, region);
    return findHue();
  };
  // Inside one ring of walls no other ring is visible.
  const auto region = std::find_if(regions.begin(), regions.end(), isWalls);
  if (region == regions.end()) return false;
  take(image, *region, area, floor, objects);
  for (const Blob& other : regions) {
    if (&other == &*region || !isRestOfRing(other)) continue;
    for (const Run& run : other.runs) objects.clear(run.row, run.begin, run.end);
    walls_.insert(walls_.end(), other.runs.begin(), other.runs.end());
  }
  return true;
}

bool LowWalls::findFaint(const cv::Mat& image, const std::vector<Blob>& hued, const BitArea& area,
                         const cv::Mat3f& floor, const cv::Mat3f& colours, BitMask& objects) {
  walls_.clear();
  ring_.runs.clear();
  for (const Blob& region : hued) {
    if (!isStrip(region) && !isAround(region)) continue;
    ring_.runs.insert(ring_.runs.end(), region.runs.begin(), region.runs.end());
  }
  if (!spansTurn(ring_, kLeastWalls) || !isFilled(ring_)) return false;
  readEdges(image, ring_);
  if (!findHue()) return false;
  take(image, ring_, area, floor, objects);
  keepAlike(colours);
  takeEdges(image, objects);
  return true;
}

/// Moves to the walls what is not floor and resembles the wall in the cells beside the ring: its foot and its
/// top.
void LowWalls::takeEdges(const cv::Mat& image, BitMask& objects) {
  beside_ = std::uint8_t{0};
  for (const Run& run : ring_.runs)
    for (int x = run.begin / kCell; x <= (run.end - 1) / kCell; ++x) beside_(run.row / kCell, x) = 1;
  cv::dilate(beside_, beside_, cv::Mat());
  for (int y = 0; y < image.rows / kCell * kCell; ++y) {
    const std::uint8_t* beside = beside_.ptr(y / kCell);
    for (int cell = 0; cell < beside_.cols; ++cell) {
      if (beside[cell] == 0) continue;
      const Edge& wall = edges_[static_cast<std::size_t>(nearest_[sectors_(y / kCell, cell)])];
      for (int x = cell * kCell; x < (cell + 1) * kCell; ++x) {
        if (!objects.at(x, y) || !isAlike(image.at<cv::Vec3b>(y, x), wall.colour, along_, across_)) continue;
        objects.clear(y, x, x + 1);
        walls_.push_back({y, x, x + 1});
      }
    }
  }
}

/// Separates the walls in the region from the objects in front of them. The objects stay in `objects`.
void LowWalls::take(const cv::Mat& image, const Blob& region, const BitArea& area, const cv::Mat3f& floor,
                    BitMask& objects) {
  findNearest();
  for (BitMask* mask : {&objects_, &eroded_, &opened_, &gaps_}) mask->clear();  // also read beyond the area
  markObjects(image, region);
  cleanObjects(image, region, area, floor);
  for (const Run& run : region.runs) {
    const auto isWall = [&](int x) { return !opened_.at(x, run.row) && !gaps_.at(x, run.row); };
    objects.keep(run.row, run.begin, run.end, opened_);
    for (int x = run.begin; x < run.end; ++x) {
      if (!isWall(x)) continue;
      const int begin = x;
      while (x < run.end && isWall(x)) ++x;
      walls_.push_back({run.row, begin, x});
    }
  }
}

void LowWalls::keepAlike(const cv::Mat3f& colours) {
  alike_.clear();
  for (const Run& run : walls_) {
    for (int begin = run.begin; begin < run.end;) {
      const cv::Point cell(std::min(begin / kCell, sectors_.cols - 1),
                           std::min(run.row / kCell, sectors_.rows - 1));
      const int end = std::min(run.end, (begin / kCell + 1) * kCell);
      const Edge& wall = edges_[static_cast<std::size_t>(nearest_[sectors_(cell)])];
      if (isAlike(colours(cell), wall.colour, kSidesAlong, kAcross)) alike_.push_back({run.row, begin, end});
      begin = end;
    }
  }
  walls_.swap(alike_);
}

void LowWalls::mark(cv::Mat1b& mask) const {
  for (const Run& run : walls_) {
    std::uint8_t* row = mask.ptr(run.row);
    std::replace(row + run.begin, row + run.end, std::uint8_t{0}, kWall);
  }
}

}  // namespace omnifleet::ground
