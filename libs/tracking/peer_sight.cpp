#include "tracking/peer_sight.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace omnifleet::tracking {
namespace {

/// How far outlines of the peer may stand out from it: share of the directions, margins.
struct Leeway {
  double directions, margins;
};
// A shadow on the floor beside the peer, or what it mirrors there, runs together with the piece that it
// touches.
constexpr Leeway kAlone{0.2, 2.0}, kWithShade{0.3, 3.5};
constexpr int kClearlyShared = 16;    // directions
constexpr double kWhole = 0.75;       // of the directions
constexpr double kLeastRatio = 0.03;  // bodies as tall as the camera is high have no far side
constexpr double kLeastLooked = 0.3;  // of the bearings that the peer takes up: others are hidden
constexpr double kMostlyUndecided = 0.5;
constexpr double kMostThrough = 0.3;  // of those bearings may go on past where the peer begins …
constexpr double kPast = 2.0;         // … by more than that many margins
constexpr int kFewestRays = 3, kFewestDirections = 8;

/// Cut directions have a σ below 0, but tell how far the thing goes at least; of others nothing is known.
bool isKnown(const View& outline, std::size_t k) {
  return std::isfinite(outline.supports.b_m[k]) && outline.supports.sigma_m[k] != 0.0F;
}

/// The k-th of n, counted from the x-axis.
Eigen::Vector2d directionOf(std::size_t k, std::size_t n) {
  const double angle_rad = 2.0 * M_PI * static_cast<double>(k) / static_cast<double>(n);
  return {std::cos(angle_rad), std::sin(angle_rad)};
}

}  // namespace

PeerSight::PeerSight(const Peer& peer, const View& eye, double margin_m) : margin_m_(margin_m) {
  const double ratio = std::max(kLeastRatio, 1.0 - peer.body.height() / eye.camera_height_m);
  top_share_ = ratio;
  for (std::size_t k = 0; k < eye.size(); ++k) {
    support_m_.push_back(peer.body.predictedSupport(eye, k, peer.centre_m, peer.heading_rad));
    normals_.push_back(directionOf(k, eye.size()));
    shrink_.push_back(support_m_.back() < 0.0 ? 1.0 : ratio);
  }
}

/// By how much it stands out from the peer's, metres.
double PeerSight::off(const View& outline, std::size_t k) const {
  return (static_cast<double>(outline.supports.b_m[k]) - support_m_[k]) * shrink_[k];
}

/// It is clearly the peer's in part, and nothing of it touches the floor before the peer does.
bool PeerSight::mayHoldShade(const View& outline) const {
  const auto toward = std::min_element(support_m_.begin(), support_m_.end());
  return off(outline, static_cast<std::size_t>(toward - support_m_.begin())) <= margin_m_ &&
         sharedDirections(outline) >= kClearlyShared;
}

bool PeerSight::encloses(const View& outline) const {
  if (outline.size() != support_m_.size()) return false;
  const Leeway leeway = mayHoldShade(outline) ? kWithShade : kAlone;
  int all = 0, out = 0;
  for (std::size_t k = 0; k < outline.size(); ++k) {
    if (!isKnown(outline, k)) continue;
    ++all;
    if (off(outline, k) > leeway.margins * margin_m_) return false;
    out += off(outline, k) > margin_m_ ? 1 : 0;
  }
  return all > 0 && out <= leeway.directions * all;
}

int PeerSight::sharedDirections(const View& outline) const {
  int shared = 0;
  for (std::size_t k = 0; k < outline.size(); ++k)
    shared += outline.usable(k) && std::abs(off(outline, k)) < margin_m_ ? 1 : 0;
  return shared;
}

bool PeerSight::isWhole(const View& outline) const {
  if (outline.size() != support_m_.size()) return false;
  std::array<int, 2> all{}, same{};  // of all directions; of those in which it touches the floor
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

void PeerSight::keepOwn(View& outline) const {
  for (std::size_t k = 0; k < outline.size(); ++k)
    if (std::abs(off(outline, k)) >= margin_m_) outline.supports.sigma_m[k] = -1.0F;
}

std::optional<PeerSight::Chord> PeerSight::chordOf(const Eigen::Vector2d& ray) const {
  Chord chord{0.0, std::numeric_limits<double>::infinity()};
  for (std::size_t k = 0; k < support_m_.size(); ++k) {
    const double along = normals_[k].dot(ray), at = support_m_[k] / along;
    if (along < 0.0) chord.begin_m = std::max(chord.begin_m, at);
    if (along > 0.0) chord.end_m = std::min(chord.end_m, at);
    if (!(chord.begin_m < chord.end_m)) return std::nullopt;
  }
  return chord;
}

bool PeerSight::isUndecided(const Scan& scan) const {
  const double nearest_m = -*std::min_element(support_m_.begin(), support_m_.end());
  const auto farthest = std::max_element(scan.range_m.begin(), scan.range_m.end());
  if (farthest == scan.range_m.end() || *farthest < nearest_m - margin_m_) return false;
  int undecided = 0, looked = 0, taken_up = 0;
  const std::size_t rays = std::min(scan.range_m.size(), scan.label.size());
  for (std::size_t i = 0; i < rays; ++i) {
    const auto chord = chordOf(directionOf(i, rays));
    if (!chord) continue;
    ++taken_up;
    const auto range_m = static_cast<double>(scan.range_m[i]);
    if (scan.label[i] == RayLabel::kInvalid || range_m < chord->begin_m - margin_m_) continue;
    ++looked;
    const double top_m = std::min(chord->end_m, chord->begin_m / top_share_ + margin_m_);
    undecided += scan.label[i] == RayLabel::kUndecided && range_m < top_m ? 1 : 0;
  }
  return undecided >= kFewestRays && undecided >= kMostlyUndecided * looked &&
         looked >= kLeastLooked * taken_up;
}

bool PeerSight::mayBeThere(const Scan& scan) const {
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
