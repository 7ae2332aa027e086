#include "ground/floor_view.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace omnifleet::ground {

namespace {

void checkLength(const options::Section& section, const std::string& key, const std::vector<double>& value) {
  if (!value.empty() && value.size() != 4) section.fail(key, "needs 4 numbers or an empty list");
}

cv::Mat1b keepRectangle(const cv::Mat1b& mask, const std::vector<double>& r) {
  if (r.empty()) return mask;
  cv::Mat1b kept(mask.size(), 0);
  const cv::Rect rect = cv::Rect(cvRound(r[0]), cvRound(r[1]), cvRound(r[2]), cvRound(r[3])) &
                        cv::Rect(0, 0, mask.cols, mask.rows);
  if (!rect.empty()) mask(rect).copyTo(kept(rect));
  return kept;
}

}  // namespace

ViewOptions ViewOptions::read(const options::Section& section) {
  ViewOptions o;
  section.read("min_depression_deg", o.min_depression_deg, {0.1, 60.0});
  section.read("mask_margin_px", o.mask_margin_px, {0.0, 100.0});
  section.read("border_margin_px", o.border_margin_px, {1.0, 100.0});
  section.read("cut_reach_px", o.cut_reach_px, {2.0, 100.0});
  section.read("seed_ring_px", o.seed_ring_px, {4.0, 1000.0});
  section.read("seed_annulus_px", o.seed_annulus_px, options::kNotNegative);
  section.read("seed_rectangle_px", o.seed_rectangle_px, options::kNotNegative);
  section.read("region_px", o.region_px, options::kNotNegative);
  checkLength(section, "seed_annulus_px", o.seed_annulus_px);
  checkLength(section, "seed_rectangle_px", o.seed_rectangle_px);
  checkLength(section, "region_px", o.region_px);
  section.finish();
  return o;
}

FloorView::FloorView(const lens::Camera& camera, const ViewOptions& options, const cv::Mat1b& occluded) {
  if (camera.height() <= 0.0) throw options::Error("camera: position_m: z must be > 0 (above the floor)");
  drawMask(camera, options, occluded);
  if (cv::countNonZero(mask_) == 0)
    throw options::Error(
        "camera: no pixel shows floor; check position_m, rotation_rpy_deg, principal_point_px and "
        "self_mask_radius_px in its sensor.yaml");
  drawCells(camera, options);
  cv::findNonZero(seeds_, seed_cells_);
  if (seed_cells_.empty())
    throw options::Error(
        "view: no seed cell shows floor; check seed_ring_px, seed_annulus_px and seed_rectangle_px");
}

std::unique_ptr<FloorView> FloorView::upward(const lens::Camera& camera) {
  ViewOptions options;
  options.min_depression_deg = -90.0;
  std::unique_ptr<FloorView> view(new FloorView());
  view->drawMask(camera, options, {});
  view->drawCells(camera, options);
  view->seedHorizon(camera);
  return view->seed_cells_.empty() ? nullptr : std::move(view);
}

/// Uses the outermost cells as seeds, except those far below the horizon. What is lower than the camera
/// appears there only if it is far away.
void FloorView::seedHorizon(const lens::Camera& camera) {
  constexpr int kCells = 3;
  constexpr double kBelow_rad = 8.0 * M_PI / 180.0;
  cv::Mat1b inner;
  cv::erode(coverage_ != 0, inner, cv::Mat1b::ones(2 * kCells + 1, 2 * kCells + 1), {-1, -1}, 1,
            cv::BORDER_CONSTANT, cv::Scalar(0));
  seeds_.setTo(0);
  seed_cells_.clear();
  for (int y = 0; y < seeds_.rows; ++y) {
    for (int x = 0; x < seeds_.cols; ++x) {
      if (coverage_(y, x) != 2 || inner(y, x) != 0) continue;
      const auto ray = camera.rayFromPixel({(x + 0.5) * kCell - 0.5, (y + 0.5) * kCell - 0.5});
      if (!ray || ray->z() < -std::sin(kBelow_rad)) continue;
      seeds_(y, x) = 255;
      seed_cells_.emplace_back(x, y);
    }
  }
}

void FloorView::drawMask(const lens::Camera& camera, const ViewOptions& options, const cv::Mat1b& occluded) {
  const auto& model = camera.model();
  mask_ = cv::Mat1b(model.image_height_px, model.image_width_px, std::uint8_t{0});
  cv::Mat1b own_body(mask_.size(), std::uint8_t{0});
  const double max_z = -std::sin(options.min_depression_deg * M_PI / 180.0);
  const double self_px =
      model.self_mask_radius_px > 0 ? model.self_mask_radius_px + options.mask_margin_px : 0.0;
  for (int v = 0; v < mask_.rows; ++v) {
    for (int u = 0; u < mask_.cols; ++u) {
      const Eigen::Vector2d pixel(u, v);
      if ((pixel - model.principal_point_px).norm() < self_px) {
        own_body(v, u) = 255;
        continue;
      }
      const auto ray = camera.rayFromPixel(pixel);
      if (ray && ray->z() <= max_z) mask_(v, u) = 255;
    }
  }
  const int margin = static_cast<int>(std::ceil(options.border_margin_px));
  const auto disc = [](int r) {
    return cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * r + 1, 2 * r + 1});
  };
  cv::erode(mask_, mask_, disc(margin), {-1, -1}, 1, cv::BORDER_CONSTANT, cv::Scalar(0));
  mask_ = keepRectangle(mask_, options.region_px);
  if (!occluded.empty()) mask_.setTo(0, occluded);
  if (!occluded.empty()) own_body |= occluded != 0;
  border_ = cv::Mat1b(mask_.size(), kBorder);
  const auto setInside = [&](int reach_px, std::uint8_t value) {
    cv::Mat1b inside;
    cv::erode(mask_, inside, disc(reach_px), {-1, -1}, 1, cv::BORDER_CONSTANT, cv::Scalar(0));
    border_.setTo(value, inside);
  };
  setInside(2, kCutReach);
  setInside(std::max(2, static_cast<int>(std::ceil(options.cut_reach_px))), 0);
  border_.setTo(kOwnBody, own_body);
}

void FloorView::drawCells(const lens::Camera& camera, const ViewOptions& options) {
  const cv::Size cells(mask_.cols / kCell, mask_.rows / kCell);
  coverage_ = cv::Mat1b(cells, std::uint8_t{0});
  seeds_ = cv::Mat1b(cells, std::uint8_t{0});
  const auto& model = camera.model();
  const auto& annulus = options.seed_annulus_px;
  const auto& box = options.seed_rectangle_px;
  const Eigen::Vector2d centre =
      annulus.empty() ? model.principal_point_px : Eigen::Vector2d(annulus[0], annulus[1]);
  const double inner = annulus.empty() ? model.self_mask_radius_px + options.mask_margin_px : annulus[2];
  const double outer = annulus.empty() ? inner + options.seed_ring_px : annulus[3];
  rows_.assign(static_cast<std::size_t>(cells.height), cv::Range(0, 0));
  for (int y = 0; y < cells.height; ++y) {
    for (int x = 0; x < cells.width; ++x) {
      const int inside = cv::countNonZero(mask_(cv::Rect(x * kCell, y * kCell, kCell, kCell)));
      coverage_(y, x) = inside == 0 ? 0 : inside == kCell * kCell ? 2 : 1;
      if (inside == 0) continue;
      auto& row = rows_[static_cast<std::size_t>(y)];
      if (row.empty()) row.start = x;
      row.end = x + 1;
      const Eigen::Vector2d p((x + 0.5) * kCell - 0.5, (y + 0.5) * kCell - 0.5);
      const double r = (p - centre).norm();
      const bool in_box = !box.empty() && p.x() >= box[0] && p.x() < box[0] + box[2] && p.y() >= box[1] &&
                          p.y() < box[1] + box[3];
      const bool is_seed = box.empty() ? r >= inner && r < outer : in_box;
      if (inside == kCell * kCell && is_seed) seeds_(y, x) = 255;
    }
  }
}

std::vector<cv::Range> FloorView::rowsWithin(int margin_cells) const {
  const int last = seeds_.rows - 1;
  std::vector<cv::Range> wider(rows_.size(), cv::Range(0, 0));
  for (int y = 0; y <= last; ++y) {
    cv::Range& to = wider[static_cast<std::size_t>(y)];
    for (int k = std::max(0, y - margin_cells); k <= std::min(last, y + margin_cells); ++k) {
      const cv::Range& row = rows_[static_cast<std::size_t>(k)];
      if (row.empty()) continue;
      const cv::Range here(std::max(0, row.start - margin_cells),
                           std::min(seeds_.cols, row.end + margin_cells));
      to = to.empty() ? here : cv::Range(std::min(to.start, here.start), std::max(to.end, here.end));
    }
  }
  return wider;
}

}  // namespace omnifleet::ground
