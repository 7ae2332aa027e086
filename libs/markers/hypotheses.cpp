#include "markers/hypotheses.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace omnifleet::markers {
namespace {

constexpr double kLeastCutArea = 0.25;  // share of a component; a smaller visible part has little information
constexpr double kCentroid_px = 0.5;    // error of a centroid: noise and mixed colours at the edges of a blob
constexpr double kLeastLever = 0.15;    // distance of two components ÷ size of the marker; a shorter line
                                      // between them gives no heading
constexpr double kLeastVote = 0.35;      // mean similarity of the colours
constexpr float kLeastOfColour = 0.04F;  // the same for the points of one colour: each colour must be present
constexpr double kVoteMargin = 0.2;  // a hypothesis with less than the best of its place minus this is wrong
constexpr double kSearchStep_px = 1.5;     // between the hypotheses of an object, at its corners
constexpr std::size_t kMostHeadings = 24;  // hypotheses of an object whose place is searched
constexpr std::size_t kMostPerObject = 6;  // hypotheses of an object that are fitted
constexpr double kSameTurn = 0.5;          // rad

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

/// Pixel of a point and the motion in the image per metre on the plane.
bool HypothesisFinder::localScale(const Eigen::Vector2d& centre_m, Eigen::Vector2d& pixel,
                                  Eigen::Matrix2d& px_per_m) const {
  const double reach_m = layout_.bounds().half_m.minCoeff();
  const auto middle = camera_.pixelFromPoint({centre_m.x(), centre_m.y(), height_m_}),
             right = camera_.pixelFromPoint({centre_m.x() + reach_m, centre_m.y(), height_m_}),
             up = camera_.pixelFromPoint({centre_m.x(), centre_m.y() + reach_m, height_m_});
  if (!middle || !right || !up) return false;
  pixel = *middle;
  px_per_m << (*right - *middle) / reach_m, (*up - *middle) / reach_m;
  return true;
}

/// px_per_m: of base_link.
double HypothesisFinder::voteAt(const cv::Mat& bgr, const Pattern& pattern, const Eigen::Vector2d& middle_px,
                                const Eigen::Matrix2d& px_per_m) const {
  std::size_t inside = 0;
  float sum = 0.0F;
  sums_.assign(table_.classes(), {0.0F, 0.0F});
  for (const LabelledPoint& point : pattern.points) {
    const Eigen::Vector2d p = middle_px + px_per_m * (point.place_m - layout_.bounds().centre_m);
    const int x = cvRound(p.x()), y = cvRound(p.y());
    if (x < 0 || y < 0 || x >= bgr.cols || y >= bgr.rows) continue;
    ++inside;
    const float similarity = table_.similarity(bgr.ptr<std::uint8_t>(y) + 3 * x, point.colour);
    sum += similarity;
    sums_[point.colour][0] += similarity;
    sums_[point.colour][1] += 1.0F;
  }
  for (const auto& [similar, count] : sums_)
    if (similar < kLeastOfColour * count) return 0.0;
  return 3 * inside < pattern.points.size() ? 0.0 : sum / static_cast<double>(inside);
}

double HypothesisFinder::vote(const cv::Mat& bgr, const Pattern& pattern, const Pose2& map_from_base) const {
  Eigen::Vector2d pixel;
  Eigen::Matrix2d px_per_m;
  if (!localScale(map_from_base * layout_.bounds().centre_m, pixel, px_per_m)) return 0.0;
  return voteAt(bgr, pattern, pixel, px_per_m * map_from_base.rotation());
}

std::optional<Eigen::Vector2d> HypothesisFinder::placeOf(const Blob& object) const {
  return camera_.planeFromPixel({object.x(), object.y()}, height_m_);
}

const std::vector<Hypothesis>& HypothesisFinder::findInObject(const cv::Mat& bgr, const Blob& object) {
  all_.clear();
  kept_.clear();
  const auto centre = placeOf(object);
  Eigen::Vector2d pixel;
  Eigen::Matrix2d px_per_m;
  if (!centre || !localScale(*centre, pixel, px_per_m)) return kept_;
  const double pixels = layout_.area() * std::abs(px_per_m.determinant());
  if (object.area_px < options_.min_area_ratio * pixels || object.area_px > options_.max_area_ratio * pixels)
    return kept_;
  const Eigen::Matrix2d m_per_px = px_per_m.inverse();
  const double px_of_half = layout_.bounds().half_m.norm() * std::sqrt(std::abs(px_per_m.determinant()));
  const int headings =
      std::clamp(static_cast<int>(std::ceil(2.0 * M_PI * px_of_half / kSearchStep_px)), 12, 72);
  for (int k = 0; k < headings; ++k) {
    const double theta = 2.0 * M_PI * k / headings;
    const Eigen::Matrix2d turn = Eigen::Rotation2Dd(theta).toRotationMatrix();
    for (std::size_t p = 0; p < layout_.patterns().size(); ++p) {
      const double vote = voteAt(bgr, layout_.patterns()[p], pixel, px_per_m * turn);
      if (vote >= kLeastVote - kVoteMargin) all_.push_back({p, {0.0, 0.0, theta}, kSearchStep_px, vote});
    }
  }
  std::stable_sort(all_.begin(), all_.end(),
                   [](const Hypothesis& a, const Hypothesis& b) { return a.vote > b.vote; });
  if (all_.size() > kMostHeadings) all_.resize(kMostHeadings);
  for (Hypothesis& h : all_) {
    const Eigen::Matrix2d turn = h.map_from_base.rotation();
    Eigen::Vector2d best(0.0, 0.0);
    for (const int dy : {-1, 0, 1}) {
      for (const int dx : {-1, 0, 1}) {
        const Eigen::Vector2d shift(kSearchStep_px * dx, kSearchStep_px * dy);
        const double vote = voteAt(bgr, layout_.patterns()[h.pattern], pixel + shift, px_per_m * turn);
        if (vote <= h.vote) continue;
        h.vote = vote;
        best = shift;
      }
    }
    const Eigen::Vector2d origin = *centre + m_per_px * best - turn * layout_.bounds().centre_m;
    h.map_from_base = {origin.x(), origin.y(), wrapAngle(h.map_from_base.theta_rad)};
  }
  all_.erase(
      std::remove_if(all_.begin(), all_.end(), [](const Hypothesis& h) { return h.vote < kLeastVote; }),
      all_.end());
  thinOut();
  if (kept_.size() > kMostPerObject) kept_.resize(kMostPerObject);
  return kept_;
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
      return same || (distance < 3.0 * near_m && h.vote < k.vote - kVoteMargin);
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
