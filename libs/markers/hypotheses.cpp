#include "markers/hypotheses.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace omnifleet::markers {
namespace {

constexpr double kLeastCutArea = 0.25;  // share of a component; a smaller visible part has little information
constexpr double kCentroid_px = 0.5;    // error of a centroid: noise and mixed colours at the edges of a blob
constexpr double kLeastLever = 0.15;    // distance of two components ÷ size of the marker; a shorter line between
                                        // them gives no heading
constexpr double kLeastVote = 0.5;      // share of points with the right class
constexpr double kVoteMargin = 0.25;    // a hypothesis with less than the best of its place minus this is wrong
constexpr double kSameTurn = 0.5;       // rad

}  // namespace

HypothesisFinder::HypothesisFinder(const lens::Camera& camera, double height_m, const Layout& layout,
                                   const ColourTable& table, const FinderOptions& options)
    : camera_(camera), height_m_(height_m), layout_(layout), table_(table), options_(options) {}

void HypothesisFinder::toPlane(const std::vector<Blob>& blobs, cv::Size image) {
  areas_.clear();
  const int border = options_.border_px;
  const double most_m2 = options_.max_area_ratio * 4.0 * layout_.bounds().half_m.prod();
  for (const Blob& blob : blobs) {
    const Eigen::Vector2d centre_px(blob.x(), blob.y());
    const auto centre = camera_.planeFromPixel(centre_px, height_m_),
               right = camera_.planeFromPixel(centre_px + Eigen::Vector2d(1, 0), height_m_),
               down = camera_.planeFromPixel(centre_px + Eigen::Vector2d(0, 1), height_m_);
    if (!centre || !right || !down) continue;
    Eigen::Matrix2d scale;
    scale << *right - *centre, *down - *centre;
    const double pixel_m2 = std::abs(scale.determinant());
    if (blob.area_px * pixel_m2 > most_m2) continue;
    areas_.push_back({blob.colour, *centre, blob.area_px * pixel_m2, std::sqrt(pixel_m2),
                      blob.left < border || blob.top < border || blob.right > image.width - 1 - border ||
                          blob.bottom > image.height - 1 - border});
  }
}

bool HypothesisFinder::plausible(const Area& area, const Component& component) const {
  const double ratio = area.area_m2 / component.area_m2;
  return area.colour == component.colour && ratio <= options_.max_area_ratio &&
         ratio >= (area.cut ? std::min(kLeastCutArea, options_.min_area_ratio) : options_.min_area_ratio);
}

/// Adds a hypothesis for each pair of blobs that may be these two components.
void HypothesisFinder::pair(const cv::Mat& bgr, std::size_t pattern, const Component& a, const Component& b) {
  const Eigen::Vector2d known = b.centre_m - a.centre_m;
  for (std::size_t i = 0; i < areas_.size(); ++i) {
    if (!plausible(areas_[i], a)) continue;
    for (std::size_t j = 0; j < areas_.size(); ++j) {
      if (i == j || !plausible(areas_[j], b)) continue;
      const Area &one = areas_[i], &other = areas_[j];
      if (one.cut && other.cut) continue;
      const Eigen::Vector2d seen = other.centre_m - one.centre_m;
      const double px = 0.5 * (one.metres_per_px + other.metres_per_px);
      double tolerance = options_.distance_tolerance_m + kCentroid_px * px, error_px = 2.0 * kCentroid_px;
      if (one.cut || other.cut) {
        // The centroid of a cut component is off by up to half its diagonal.
        tolerance += 0.5 * std::sqrt(2.0 * (one.cut ? a : b).area_m2);
        error_px = 8.0 * kCentroid_px;
      }
      if (std::abs(seen.norm() - known.norm()) > tolerance) continue;
      const double theta = std::atan2(seen.y(), seen.x()) - std::atan2(known.y(), known.x());
      const Eigen::Vector2d origin = 0.5 * (one.centre_m + other.centre_m) -
                                     Eigen::Rotation2Dd(theta) * (0.5 * (a.centre_m + b.centre_m));
      Hypothesis hypothesis{pattern, {origin.x(), origin.y(), wrapAngle(theta)}, error_px, 0.0};
      hypothesis.vote = vote(bgr, layout_.patterns()[pattern], hypothesis.map_from_base);
      if (hypothesis.vote >= kLeastVote) all_.push_back(hypothesis);
    }
  }
}

double HypothesisFinder::vote(const cv::Mat& bgr, const Pattern& pattern, const Pose2& map_from_base) const {
  const auto pixelOf = [&](const Eigen::Vector2d& in_base) {
    const Eigen::Vector2d p = map_from_base * in_base;
    return camera_.pixelFromPoint({p.x(), p.y(), height_m_});
  };
  const Rectangle& bounds = layout_.bounds();
  const auto middle = pixelOf(bounds.centre_m),
             ahead = pixelOf(bounds.centre_m + Eigen::Vector2d(bounds.half_m.x(), 0)),
             left = pixelOf(bounds.centre_m + Eigen::Vector2d(0, bounds.half_m.y()));
  if (!middle || !ahead || !left) return 0.0;
  Eigen::Matrix2d scale;
  scale << (*ahead - *middle) / bounds.half_m.x(), (*left - *middle) / bounds.half_m.y();
  std::size_t inside = 0, right = 0;
  for (const LabelledPoint& point : pattern.points) {
    const Eigen::Vector2d p = *middle + scale * (point.place_m - bounds.centre_m);
    const int x = cvRound(p.x()), y = cvRound(p.y());
    if (x < 0 || y < 0 || x >= bgr.cols || y >= bgr.rows) continue;
    ++inside;
    right += table_.classOf(bgr.ptr<std::uint8_t>(y) + 3 * x) == point.colour ? 1 : 0;
  }
  return 3 * inside < pattern.points.size() ? 0.0 : static_cast<double>(right) / static_cast<double>(inside);
}

/// Keeps the best of equal hypotheses, and of those at one place only the ones that are about as good.
void HypothesisFinder::thinOut() {
  std::stable_sort(all_.begin(), all_.end(),
                   [](const Hypothesis& a, const Hypothesis& b) { return a.vote > b.vote; });
  kept_.clear();
  const double near_m = 0.5 * layout_.bounds().half_m.minCoeff();
  for (const Hypothesis& h : all_) {
    const bool worse = std::any_of(kept_.begin(), kept_.end(), [&](const Hypothesis& k) {
      const double distance = (k.map_from_base.translation() - h.map_from_base.translation()).norm();
      const double turn = std::abs(wrapAngle(k.map_from_base.theta_rad - h.map_from_base.theta_rad));
      const bool same = distance < near_m && k.pattern == h.pattern && turn < kSameTurn;
      return same || (distance < 2.0 * near_m && h.vote < k.vote - kVoteMargin);
    });
    if (!worse) kept_.push_back(h);
  }
}

const std::vector<Hypothesis>& HypothesisFinder::find(const cv::Mat& bgr, const std::vector<Blob>& blobs) {
  toPlane(blobs, bgr.size());
  all_.clear();
  const double least_m = kLeastLever * 2.0 * layout_.bounds().half_m.norm();
  const auto& patterns = layout_.patterns();
  for (std::size_t p = 0; p < patterns.size(); ++p) {
    const auto& components = patterns[p].components;
    for (std::size_t i = 0; i < components.size(); ++i) {
      for (std::size_t j = i + 1; j < components.size(); ++j) {
        if ((components[i].centre_m - components[j].centre_m).norm() >= least_m)
          pair(bgr, p, components[i], components[j]);
      }
    }
  }
  thinOut();
  return kept_;
}

}  // namespace omnifleet::markers
