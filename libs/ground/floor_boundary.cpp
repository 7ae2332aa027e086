#include "ground/floor_boundary.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace omnifleet::ground {
namespace {

constexpr int kReach_px = 10;  // of the profile to both sides of the edge
constexpr int kPerPixel = 2;   // samples of the profile
constexpr int kSamples = 2 * kReach_px * kPerPixel + 1;
constexpr double kWindow_px = 2.5;  // half width of the area that places the edge
constexpr double kPlateau_px = 2.0, kPlateauEnd_px = 4.0, kFar_px = 5.0, kFarEnd_px = 8.0;
constexpr int kRounds = 3;
// Second differences that show the scatter of added edges: from beams so far apart, of so many beams to
// either side.
constexpr int kLag = 4, kBeside = 10;
constexpr std::size_t kLeastTriples = 5;
constexpr float kToSigma = 1.4826f / 1.2247449f;  // median of |b − (a + c)/2| → σ of one value

/// Samples along one bearing, kReach_px to both sides of a step.
struct Profile {
  std::array<cv::Vec3f, kSamples> colour;

  /// @param from, to pixels from the middle
  cv::Vec3f mean(double from, double to) const {
    cv::Vec3f sum(0, 0, 0);
    int n = 0;
    const int first = std::max(0, static_cast<int>(std::ceil((from + kReach_px) * kPerPixel))),
              last = std::min(kSamples - 1, static_cast<int>(std::floor((to + kReach_px) * kPerPixel)));
    for (int i = first; i <= last; ++i, ++n) sum += colour[static_cast<std::size_t>(i)];
    return n > 0 ? sum * (1.0f / static_cast<float>(n)) : sum;
  }
  cv::Vec3f at(double offset_px) const {
    const double i = std::clamp((offset_px + kReach_px) * kPerPixel, 0.0, kSamples - 1.001);
    const auto k = static_cast<std::size_t>(i);
    const auto f = static_cast<float>(i - static_cast<double>(k));
    return colour[k] * (1 - f) + colour[k + 1] * f;
  }
};

}  // namespace

BoundaryOptions BoundaryOptions::read(const options::Section& section) {
  BoundaryOptions o;
  section.read("bearings", o.bearings, {360, 1440});
  section.read("max_angle_deg", o.max_angle_deg, {45.0, 89.5});
  section.read("run_px", o.run_px, {1.0, 20.0});
  section.read("min_contrast", o.min_contrast, {1.0, 255.0});
  section.read("wall_contrast", o.wall_contrast, {1.0, 255.0});
  section.read("wall_sigma_px", o.wall_sigma_px, {0.01, 5.0});
  section.read("max_shift_px", o.max_shift_px, {0.5, 6.0});
  section.read("sigma_px", o.sigma_px, {0.01, 5.0});
  section.finish();
  return o;
}

FloorBoundary::FloorBoundary(const lens::Camera& camera, const FloorView& view,
                             const BoundaryOptions& options)
    : options_(options), paths_(camera, view, options.bearings, options.max_angle_deg * M_PI / 180.0) {
  boundary_.origin_m = camera.foot();
  boundary_.inverse_m.resize(paths_.size());
  boundary_.sigma.resize(paths_.size());
  added_.resize(paths_.size());
  scatter_.reserve(paths_.size());
}

Boundary& FloorBoundary::find(const cv::Mat& image, const cv::Mat1b& objects) {
  for (std::size_t i = 0; i < paths_.size(); ++i) {
    boundary_.inverse_m[i] = boundary_.sigma[i] = 0.0f;
    const int step = firstEnd(paths_[i], objects);
    if (step >= paths_[i].count) continue;
    if (const auto edge = refine(i, step, image)) {
      boundary_.inverse_m[i] = edge->inverse_m;
      boundary_.sigma[i] = edge->sigma;
    }
  }
  return boundary_;
}

void FloorBoundary::complete(const cv::Mat& image, const std::vector<float>& expected_m, Boundary& boundary) {
  const std::size_t beams = paths_.size();
  for (std::size_t i = 0; i < beams; ++i) {
    added_[i] = 0;
    if (boundary.inverse_m[i] > 0.0f || !(expected_m[i] > 0.0f)) continue;
    const auto edge = refine(i, static_cast<int>(std::lround(paths_.placeOf(paths_[i], expected_m[i]))),
                             image, options_.wall_contrast);
    if (!edge) continue;
    boundary.inverse_m[i] = edge->inverse_m;
    boundary.sigma[i] =
        edge->sigma * static_cast<float>(std::max(1.0, options_.wall_sigma_px / options_.sigma_px));
    added_[i] = 1;
  }
  // A straight line is s(b − lag) + s(b + lag) = 2 cos(lag) · s(b) in inverse range.
  const auto middle = static_cast<float>(2.0 * std::cos(2.0 * M_PI * kLag / static_cast<double>(beams)));
  for (std::size_t i = 0; i < beams; ++i) {
    if (added_[i] == 0) continue;
    scatter_.clear();
    for (int k = -kBeside; k <= kBeside; ++k) {
      const auto at = [&](int beside) {
        const auto n = static_cast<int>(beams);
        return static_cast<std::size_t>((static_cast<int>(i) + k + beside + n) % n);
      };
      const std::size_t a = at(-kLag), b = at(0), c = at(kLag);
      if (added_[a] == 0 || added_[b] == 0 || added_[c] == 0) continue;
      scatter_.push_back(
          std::abs(boundary.inverse_m[b] - (boundary.inverse_m[a] + boundary.inverse_m[c]) / middle));
    }
    if (scatter_.size() < kLeastTriples) {
      added_[i] = 2;  // alone
      continue;
    }
    const auto half = scatter_.begin() + static_cast<std::ptrdiff_t>(scatter_.size() / 2);
    std::nth_element(scatter_.begin(), half, scatter_.end());
    boundary.sigma[i] = std::max(boundary.sigma[i], kToSigma * *half);
  }
  for (std::size_t i = 0; i < beams; ++i)
    if (added_[i] == 2) boundary.inverse_m[i] = boundary.sigma[i] = 0.0f;
}

int FloorBoundary::firstEnd(const BearingPaths::Path& path, const cv::Mat1b& objects) const {
  int run = 0;
  for (int k = 0; k < path.count; ++k) {
    run = objects(paths_.pixel(path, k)) != 0 ? run + 1 : 0;
    if (run >= options_.run_px) return k - run + 1;
  }
  return path.count;
}

/// Three rounds around the edge found so far.
std::optional<FloorBoundary::Edge> FloorBoundary::refine(std::size_t bearing, int step, const cv::Mat& image,
                                                         double min_contrast) const {
  const BearingPaths::Path& path = paths_[bearing];
  if (step < kReach_px / 2 || step + kReach_px / 2 >= path.count) return std::nullopt;
  Profile profile;
  for (int i = 0; i < kSamples; ++i)
    profile.colour[static_cast<std::size_t>(i)] =
        paths_.colour(image, path, step + static_cast<double>(i) / kPerPixel - kReach_px);
  double shift = 0.0;
  for (int round = 0; round < kRounds; ++round) {
    const cv::Vec3f inner = profile.mean(shift - kPlateauEnd_px, shift - kPlateau_px),
                    outer = profile.mean(shift + kPlateau_px, shift + kPlateauEnd_px);
    cv::Vec3f gradient(0, 0, 0);  // of the floor, per pixel outwards
    if (step + shift - kFarEnd_px >= 0.0)
      gradient = (inner - profile.mean(shift - kFarEnd_px, shift - kFar_px)) *
                 static_cast<float>(2.0 / (kFar_px + kFarEnd_px - kPlateau_px - kPlateauEnd_px));
    const cv::Vec3f floor = inner + gradient * static_cast<float>(0.5 * (kPlateau_px + kPlateauEnd_px)),
                    contrast = outer - floor;
    const float square = contrast.dot(contrast);
    if (square < min_contrast * min_contrast) return std::nullopt;
    double outside = 0.0;
    int n = 0;
    constexpr double kStep_px = 0.5 / kPerPixel;
    for (double d = -kWindow_px + 0.5 * kStep_px; d < kWindow_px; d += kStep_px, ++n) {
      const cv::Vec3f here = floor + gradient * static_cast<float>(std::min(d, 0.0));
      outside += std::clamp((profile.at(shift + d) - here).dot(contrast) / square, -0.5f, 1.5f);
    }
    shift += std::clamp((0.5 - outside / n) * 2.0 * kWindow_px, -1.5, 1.5);
    if (std::abs(shift) > options_.max_shift_px) return std::nullopt;
  }
  const double edge = step + shift;
  if (edge < 1.0 || edge + 2.0 >= path.count) return std::nullopt;
  return Edge{paths_.inverseAt(path, edge),
              static_cast<float>(options_.sigma_px) * std::abs(paths_.slopeAt(path, edge))};
}

}  // namespace omnifleet::ground
