#include "distance_vector/distance_vector.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>

#include "distance_vector/scale_fit.h"

namespace omnifleet::distance_vector {
namespace {

constexpr double kLeastShare = 0.03;  // of the columns that see floor: with fewer edges nothing is usable
// Columns that continue above the horizon, or end without an edge, per column with an end, or with an edge.
constexpr double kMostThrough = 3.0;
constexpr int kSameEdge_px = 8;  // rows between one edge in level and in hue: JPEG codes hue in blocks of 16
// An edge so near to the farthest row is blurred over it by smoothing and by JPEG, which halves hue.
constexpr float kBlur_px = 2.0f;
constexpr float kWholePixelSigma_px = 0.4f;  // σ of a boundary in whole pixels, threshold included

}  // namespace

DistanceVector::DistanceVector(const lens::Camera& camera, const Options& options)
    : options_(options),
      foot_m_(camera.foot()),
      view_(camera, options),
      colour_(options.walk),
      walk_(view_, options.walk),
      split_(view_, options.walk),
      edges_(options.edge),
      fusion_(options.edge.window_px, static_cast<float>(options.jump_px),
              static_cast<float>(options.edge.hue_shared_px)),
      weak_edges_(2 * options.edge.window_px + 1, static_cast<float>(options.jump_px),
                  static_cast<float>(options.outlier_sigmas),
                  static_cast<float>(options.edge.weak_shared_px)),
      sampler_(options),
      scale_(makeScale(options.literal)) {
  const auto columns = static_cast<std::size_t>(view_.size().width);
  ends_.resize(columns);
  pairs_.resize(columns);
  hits_.resize(columns);
  floor_tops_.resize(columns);
  edge_rows_.assign(columns, std::numeric_limits<float>::quiet_NaN());
  mask_ = cv::Mat::zeros(view_.size(), CV_8UC1);
  sampler_.clear(foot_m_, view_.blindM());
}

void DistanceVector::process(const cv::Mat& bgr) {
  if (bgr.type() != CV_8UC3 || bgr.size() != view_.size())
    throw std::invalid_argument("distance vector: the image must be BGR, 8 bits, of the camera's size");
  smoothed_.compute(bgr);
  std::fill(edge_rows_.begin(), edge_rows_.end(), std::numeric_limits<float>::quiet_NaN());
  if (!findFloor(bgr)) {
    for (ColumnEnd& end : ends_) end = ColumnEnd{End::kUndecided, 0, view_.size().height};
    sampler_.clear(options_.method == Method::kLiteral ? Eigen::Vector2d(0, 0) : foot_m_, view_.blindM());
  } else if (options_.method == Method::kLiteral) {
    scaleLiterally();
  } else {
    project();
  }
  drawMask();
}

/// Tries the candidates for the floor's colour. Sets ends_ and fault_.
bool DistanceVector::findFloor(const cv::Mat& bgr) {
  fault_ = Fault::kNone;
  const bool knows_floor = colour_.hasMemory();
  bool other_floor = false;
  for (const FloorSample& sample : colour_.find(smoothed_)) {
    ends_ = walk_.walk(smoothed_, sample);
    const bool is_known = knows_floor && sample.remembered;
    splitColumns(sample, is_known);
    if (!isPlausible(ends_)) continue;
    // The literal method has whole pixels, without edges.
    if (options_.method == Method::kProjected && !measureEdges(bgr)) continue;
    // Something of another colour fills the bottom of the image: an object, unless it stays.
    if (knows_floor && !sample.remembered) {
      other_floor = true;
      if (new_floor_frames_ + 1 < options_.walk.new_floor_frames) continue;
    }
    new_floor_frames_ = 0;
    colour_.remember(sample);
    return true;
  }
  if (other_floor) ++new_floor_frames_;
  fault_ = knows_floor && colour_.rememberedShare() < 0.5 ? Fault::kTooNear : Fault::kNoFloor;
  return false;
}

/// Looks for the foot of what continues above the horizon, and of bands that a shadow explains pixel by
/// pixel. A shadow changes the level only: where the column shows another hue from the band upwards, the band
/// is an object.
void DistanceVector::splitColumns(const FloorSample& sample, bool is_known) {
  split_.begin(sample, is_known ? std::optional<cv::Vec3f>(colour_.knownDirection()) : std::nullopt);
  for (int u = 0; u < view_.size().width; ++u) {
    ColumnEnd& end = ends_[static_cast<std::size_t>(u)];
    const bool beyond_horizon = end.end == End::kUndecided && end.floor >= view_.size().height;
    const bool is_band = end.end == End::kUndecided && end.band_end >= 0;
    if (!beyond_horizon && !is_band) continue;
    const auto row = split_.find(smoothed_, u);
    if (!row) continue;
    if (is_band && (*row <= end.band_end || !split_.continues(*row, end.band_end))) continue;
    // The band itself is the edge, unless floor in shadow lies before the object.
    const bool at_band = is_band && std::abs(*row - end.row) <= kSameEdge_px;
    const int foot = at_band ? end.row : *row;
    end = ColumnEnd{};
    end.end = End::kEdge;
    end.row = foot;
    end.floor = foot + 1;
    end.weak = !at_band;
  }
}

/// Floor ends at or below the horizon. What continues above it in most columns is no floor.
bool DistanceVector::isPlausible(const std::vector<ColumnEnd>& ends) const {
  int seeing = 0, ending = 0, through = 0;
  for (const ColumnEnd& end : ends) {
    seeing += end.end != End::kOutside ? 1 : 0;
    ending += end.end == End::kEdge || end.end == End::kFloorEnd ? 1 : 0;
    through += end.end == End::kUndecided && end.floor >= view_.size().height ? 1 : 0;
  }
  return ending > 0 && ending >= kLeastShare * seeing && through <= kMostThrough * ending;
}

/// Sets pairs_. Whether what ends the floor has an edge in the image: without one in most columns the colour
/// only drifts, like that of the sky. Floor up to the farthest row has an edge there, unless the image ends
/// before.
bool DistanceVector::measureEdges(const cv::Mat& bgr) {
  const int height = view_.size().height;
  const float noise = edges_.noise(bgr, height - static_cast<int>(options_.walk.seed_rows * height), height);
  int seeing = 0, sharp = 0, smooth = 0;
  for (int u = 0; u < view_.size().width; ++u) {
    const auto i = static_cast<std::size_t>(u);
    const ColumnEnd& end = ends_[i];
    seeing += end.end != End::kOutside ? 1 : 0;
    pairs_[i] = {};
    if (end.end != End::kEdge && end.end != End::kFloorEnd) continue;
    const ColumnEdges::Pair pair = edges_.find(bgr, view_, u, end.row, end.weak, noise);
    if (end.end == End::kEdge) pairs_[i] = pair;
    const bool is_sharp = (pair.luma && !pair.luma->is_smooth) || (pair.hue && !pair.hue->is_smooth) ||
                          (end.end == End::kFloorEnd && !view_.seesHorizon(u));
    ++(is_sharp ? sharp : smooth);
  }
  return sharp > 0 && sharp >= kLeastShare * seeing && smooth <= kMostThrough * sharp;
}

void DistanceVector::drawMask() {
  for (std::size_t u = 0; u < ends_.size(); ++u) {
    const End end = ends_[u].end;
    const bool any = end != End::kOutside && end != End::kNear;
    floor_tops_[u] = any ? ends_[u].floor : mask_.rows;
  }
  const int* tops = floor_tops_.data();
  for (int v = 0; v < mask_.rows; ++v) {
    auto* row = mask_.ptr<std::uint8_t>(v);
    for (int u = 0; u < mask_.cols; ++u) row[u] = v >= tops[u] ? 255 : 0;
  }
}

void DistanceVector::project() {
  const std::vector<EdgeFusion::Edge>& edges = weak_edges_.smooth(ends_, fusion_.fuse(pairs_));
  for (int u = 0; u < view_.size().width; ++u) {
    const auto i = static_cast<std::size_t>(u);
    ColumnHit& hit = hits_[i];
    hit = ColumnHit{};
    hit.end = ends_[i].end;
    hit.low = ends_[i].low;
    hit.beyond = ends_[i].beyond;
    hit.row = static_cast<float>(ends_[i].row);
    if (hit.end == End::kFloorEnd) hit.row += kBlur_px;
    float sigma_px = 0.5f;
    if (hit.end == End::kEdge) {
      if (std::isnan(edges[i].row)) {
        hit.end = End::kUndecided;
        continue;
      }
      edge_rows_[i] = hit.row = edges[i].row;
      sigma_px = edges[i].sigma_px;
      if (hit.row < static_cast<float>(view_.limitRow(u))) {
        hit.end = End::kFloorEnd;
        hit.row = static_cast<float>(view_.limitRow(u)) + kBlur_px;
      }
    }
    if (hit.end != End::kEdge && hit.end != End::kFloorEnd) continue;
    hit.bearing_rad = view_.bearing(u, hit.row);
    hit.inverse_m = view_.inverseRange(u, hit.row);
    hit.per_px = std::abs(view_.slope(u, hit.row));
    hit.sigma = sigma_px * hit.per_px;
  }
  sampler_.sample(hits_, foot_m_, view_.blindM());
}

/// Eq. 1–5: d_r in pixels from the bottom row, α(d_r), and bearings that span the field of view evenly.
void DistanceVector::scaleLiterally() {
  const double metres = options_.literal.metres_per_ceiling_px;
  const double field_rad = options_.literal.field_of_view_deg * M_PI / 180.0;
  const int width = view_.size().width, bottom = view_.size().height - 1;
  for (int u = 0; u < width; ++u) {
    const auto i = static_cast<std::size_t>(u);
    ColumnHit& hit = hits_[i];
    hit = ColumnHit{};
    hit.end = ends_[i].end;
    if (hit.end != End::kEdge) {
      if (hit.end == End::kFloorEnd) hit.end = End::kUndecided;  // eq. 1 gives no distance there
      continue;
    }
    const double robot_px = bottom - ends_[i].row;
    edge_rows_[i] = hit.row = static_cast<float>(ends_[i].row);
    const auto ceiling_px = scale_.ceiling_px(robot_px);
    if (!ceiling_px) {
      hit.end = End::kUndecided;
      continue;
    }
    const auto below = scale_.ceiling_px(robot_px - 1.0), above = scale_.ceiling_px(robot_px + 1.0);
    const double slope =
        (above.value_or(*ceiling_px) - below.value_or(*ceiling_px)) / (above && below ? 2.0 : 1.0);
    const double range_m = metres * *ceiling_px;
    const double sigma_m =
        metres * std::hypot(static_cast<double>(kWholePixelSigma_px) * slope, robot_px * scale_.sigma_alpha);
    hit.bearing_rad = static_cast<float>(field_rad * (0.5 - (u + 0.5) / width));
    hit.inverse_m = static_cast<float>(1.0 / range_m);
    hit.sigma = static_cast<float>(sigma_m / (range_m * range_m));
  }
  sampler_.sample(hits_, {0.0, 0.0}, 0.0);
}

DistanceVector::Scale DistanceVector::makeScale(const LiteralOptions& options) {
  Scale scale;
  if (options.scale_file.empty()) {
    scale.ceiling_px = [](double robot_px) -> std::optional<double> {
      const auto alpha = paperAlpha(robot_px);
      if (!alpha) return std::nullopt;
      return *alpha * robot_px;
    };
    double sum = 0.0;
    for (const ScalePair& pair : paperTable()) sum += std::pow(pair.alpha() - *paperAlpha(pair.robot_px), 2);
    scale.sigma_alpha = std::sqrt(sum / static_cast<double>(paperTable().size()));
    return scale;
  }
  const ScaleFit fit = ScaleFit::load(options.scale_file);
  scale.sigma_alpha = fit.sigma();
  scale.ceiling_px = [fit](double robot_px) { return fit.ceilingPx(robot_px); };
  return scale;
}

}  // namespace omnifleet::distance_vector
