#include "tracking/peer_outline.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace omnifleet::tracking {
namespace {

/// By how much outlines of pieces may exceed the peer's: share of the directions, and number of margins.
struct Leeway {
  double directions, margins;
};
// A shadow on the floor beside the peer, or its reflection, merges with the piece that it touches.
constexpr Leeway kAlone{0.2, 2.0}, kWithShadow{0.3, 3.5};
constexpr int kClearlyShared = 16;     // directions
constexpr double kWhole = 0.75;        // share of the directions
constexpr double kLeastRatio = 0.03;   // u = 1 − h/H; a body as tall as the camera has no far side
constexpr double kLeastReached = 0.3;  // share of the bearings to the peer on which the scan must reach it
constexpr double kMostlyUndecided = 0.5;
constexpr double kMostThrough = 0.3;  // share of the bearings to the peer that may see past its near side
constexpr double kPast = 2.0;         // margins behind the near side from which a bearing sees past it
constexpr int kFewestRays = 3, kFewestDirections = 8;

/// Directions with σ < 0 are cut: they give a lower bound of the extent. Directions with σ = 0 are unknown.
bool isKnown(const View& outline, std::size_t k) {
  return std::isfinite(outline.supports.b_m[k]) && outline.supports.sigma_m[k] != 0.0F;
}

/// Unit vector k of n, counted from the x-axis.
Eigen::Vector2d directionOf(std::size_t k, std::size_t n) {
  const double angle_rad = 2.0 * M_PI * static_cast<double>(k) / static_cast<double>(n);
  return {std::cos(angle_rad), std::sin(angle_rad)};
}

}  // namespace

PeerOutline::PeerOutline(const Peer& peer, const View& eye, double margin_m) : margin_m_(margin_m) {
  const double ratio = std::max(kLeastRatio, 1.0 - peer.body.height() / eye.camera_height_m);
  top_share_ = ratio;
  for (std::size_t k = 0; k < eye.size(); ++k) {
    support_m_.push_back(peer.body.predictedSupport(eye, k, peer.centre_m, peer.heading_rad));
    normals_.push_back(directionOf(k, eye.size()));
    shrink_.push_back(support_m_.back() < 0.0 ? 1.0 : ratio);
  }
}

/// Excess over the peer's outline, metres on the floor under the body.
double PeerOutline::off(const View& outline, std::size_t k) const {
  return (static_cast<double>(outline.supports.b_m[k]) - support_m_[k]) * shrink_[k];
}

/// True if the outline clearly matches the peer in part, and nothing of it touches the floor in front of the
/// peer.
bool PeerOutline::mayHoldShadow(const View& outline) const {
  const auto toward = std::min_element(support_m_.begin(), support_m_.end());
  return off(outline, static_cast<std::size_t>(toward - support_m_.begin())) <= margin_m_ &&
         sharedDirections(outline) >= kClearlyShared;
}

bool PeerOutline::encloses(const View& outline) const {
  if (outline.size() != support_m_.size()) return false;
  const Leeway leeway = mayHoldShadow(outline) ? kWithShadow : kAlone;
  int all = 0, out = 0;
  for (std::size_t k = 0; k < outline.size(); ++k) {
    if (!isKnown(outline, k)) continue;
    ++all;
    if (off(outline, k) > leeway.margins * margin_m_) return false;
    out += off(outline, k) > margin_m_ ? 1 : 0;
  }
  return all > 0 && out <= leeway.directions * all;
}

int PeerOutline::sharedDirections(const View& outline) const {
  int shared = 0;
  for (std::size_t k = 0; k < outline.size(); ++k)
    shared += outline.usable(k) && std::abs(off(outline, k)) < margin_m_ ? 1 : 0;
  return shared;
}

bool PeerOutline::isWhole(const View& outline) const {
  if (outline.size() != support_m_.size()) return false;
  std::array<int, 2> all{}, same{};  // of all directions; of those on the contact side
  for (std::size_t k = 0; k < outline.size(); ++k) {
    if (!outline.usable(k)) continue;
    const bool is_same = std::abs(off(outline, k)) < margin_m_;
    for (const std::size_t at : {0, 1}) {
      if (at == 1 && support_m_[k] >= 0.0) continue;
      ++all[at];
      same[at] += is_same ? 1 : 0;
    }
  }
  return all[0] >= kFewestDirections && all[1] > 0 && same[0] >= kWhole * all[0] &&
         same[1] >= kWhole * all[1];
}

void PeerOutline::keepOwn(View& outline) const {
  for (std::size_t k = 0; k < outline.size(); ++k)
    if (std::abs(off(outline, k)) >= margin_m_) outline.supports.sigma_m[k] = -1.0F;
}

std::optional<PeerOutline::Chord> PeerOutline::chordOf(const Eigen::Vector2d& ray) const {
  Chord chord{0.0, std::numeric_limits<double>::infinity()};
  for (std::size_t k = 0; k < support_m_.size(); ++k) {
    const double along = normals_[k].dot(ray), at = support_m_[k] / along;
    if (along < 0.0) chord.begin_m = std::max(chord.begin_m, at);
    if (along > 0.0) chord.end_m = std::min(chord.end_m, at);
    if (!(chord.begin_m < chord.end_m)) return std::nullopt;
  }
  return chord;
}

bool PeerOutline::isUndecided(const Scan& scan) const {
  const double nearest_m = -*std::min_element(support_m_.begin(), support_m_.end());
  const auto farthest = std::max_element(scan.range_m.begin(), scan.range_m.end());
  if (farthest == scan.range_m.end() || *farthest < nearest_m - margin_m_) return false;
  int undecided = 0, reached = 0, taken_up = 0;
  const std::size_t rays = std::min(scan.range_m.size(), scan.label.size());
  for (std::size_t i = 0; i < rays; ++i) {
    const auto chord = chordOf(directionOf(i, rays));
    if (!chord) continue;
    ++taken_up;
    const auto range_m = static_cast<double>(scan.range_m[i]);
    if (scan.label[i] == RayLabel::kInvalid || range_m < chord->begin_m - margin_m_) continue;
    ++reached;
    const double top_m = std::min(chord->end_m, chord->begin_m / top_share_ + margin_m_);
    undecided += scan.label[i] == RayLabel::kUndecided && range_m < top_m ? 1 : 0;
  }
  return undecided >= kFewestRays && undecided >= kMostlyUndecided * reached &&
         reached >= kLeastReached * taken_up;
}

bool PeerOutline::mayBeThere(const Scan& scan) const {
  int through = 0, taken_up = 0;
  const std::size_t rays = std::min(scan.range_m.size(), scan.label.size());
  for (std::size_t i = 0; i < rays; ++i) {
    const auto chord = chordOf(directionOf(i, rays));
    if (!chord) continue;
    ++taken_up;
    through +=
        scan.label[i] != RayLabel::kInvalid && scan.range_m[i] > chord->begin_m + kPast * margin_m_ ? 1 : 0;
  }
  return through <= kMostThrough * taken_up;
}

void joinOutlines(const View& other, View& outline) {
  for (std::size_t k = 0; k < outline.size(); ++k) {
    const bool is_less = isKnown(outline, k) && other.supports.b_m[k] <= outline.supports.b_m[k];
    if (!isKnown(other, k) || is_less) continue;
    outline.supports.b_m[k] = other.supports.b_m[k];
    outline.supports.sigma_m[k] = other.supports.sigma_m[k];
  }
}

}  // namespace omnifleet::tracking
