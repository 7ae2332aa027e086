#pragma once

// For the translation units of the adapters only.

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "adapters/adapters.h"
#include "idl/common.h"
#include "observation/observation.h"

namespace omnifleet::adapters {

inline v1::Point2 point(const Eigen::Vector2d& from) {
  v1::Point2 to;
  to.x(from.x());
  to.y(from.y());
  return to;
}

inline v1::Pose2 pose(const Pose2& from) {
  v1::Pose2 to;
  to.x(from.x_m);
  to.y(from.y_m);
  to.theta(from.theta_rad);
  return to;
}

inline Eigen::Vector2d point(const v1::Point2& from) {
  return {from.x(), from.y()};
}
inline Pose2 pose(const v1::Pose2& from) {
  return {from.x(), from.y(), from.theta()};
}

template <int N, typename Array>
void matrixToWire(const Eigen::Matrix<double, N, N>& from, Array& to) {
  for (int r = 0; r < N; ++r) {
    for (int c = 0; c < N; ++c) to[static_cast<std::size_t>(r * N + c)] = from(r, c);
  }
}

template <int N, typename Array>
Eigen::Matrix<double, N, N> matrixFromWire(const Array& from) {
  Eigen::Matrix<double, N, N> to;
  for (int r = 0; r < N; ++r) {
    for (int c = 0; c < N; ++c) to(r, c) = from[static_cast<std::size_t>(r * N + c)];
  }
  return to;
}

/// Converts at most `limit` elements of `from` (the bound of the IDL sequence) with `convert(element,
/// target)`.
template <typename From, typename To, typename Convert>
void sequenceToWire(const From& from, std::size_t limit, To& to, Convert convert) {
  to.resize(std::min(from.size(), limit));
  for (std::size_t i = 0; i < to.size(); ++i) convert(from[i], to[i]);
}

/// True when all numbers are finite.
template <typename... Numbers>
bool finite(const Numbers&... numbers) {
  return (std::isfinite(static_cast<double>(numbers)) && ...);
}

template <typename Enum>
bool enumFromWire(std::uint32_t from, Enum last, Enum& to) {
  if (from > static_cast<std::uint32_t>(last)) return false;
  to = static_cast<Enum>(from);
  return true;
}

void toWire(const ScenePoint& from, v1::ScenePoint& to);
bool fromWire(const v1::ScenePoint& from, ScenePoint& to);
void toWire(const Motion& from, v1::Motion& to);
bool fromWire(const v1::Motion& from, Motion& to);
void toWire(const FloorMotion& from, v1::FloorMotion& to);
bool fromWire(const v1::FloorMotion& from, FloorMotion& to);
void toWire(const Scan& from, v1::Scan& to);
bool fromWire(const v1::Scan& from, Scan& to);
void toWire(const Boundary& from, v1::Boundary& to);
bool fromWire(const v1::Boundary& from, Boundary& to);
void toWire(const Appearance& from, v1::Appearance& to);
bool fromWire(const v1::Appearance& from, Appearance& to);
void toWire(const SupportFunction& from, v1::Supports& to);
void fromWire(const v1::Supports& from, SupportFunction& to);
void toWire(const Polygon& from, std::vector<v1::Point2>& to);
bool fromWire(const std::vector<v1::Point2>& from, Polygon& to);

/// The part that local map and objects of a frame share: all fields except the objects.
template <typename Frame, typename Wire>
void frameToWire(const Frame& from, RunClock clock, Wire& to) {
  to.robot(from.robot);
  fillHeader(from.acquired_ns, from.sequence, clock, to.header());
  to.state(static_cast<v1::FrameState>(from.state));
  to.camera_height_m(from.camera_height_m);
  toWire(from.motion, to.motion());
  toWire(from.floor_motion, to.floor_motion());
  toWire(from.scan, to.scan());
  toWire(from.boundary, to.boundary());
  toWire(from.appearance, to.appearance());
}
/// Reduces an invalid frame to its robot, time and sequence number. @return false
template <typename Frame>
bool invalidFrame(Frame& frame) {
  Frame left;
  left.robot = frame.robot;
  left.acquired_ns = frame.acquired_ns;
  left.sequence = frame.sequence;
  left.state = FrameState::kNonFinite;
  frame = std::move(left);
  return false;
}
template <typename Wire, typename Frame>
bool frameFromWire(const Wire& from, Frame& to) {
  to.robot = from.robot().to_string();
  to.acquired_ns = from.header().acquired_ns();
  to.sequence = from.header().sequence_number();
  to.camera_height_m = from.camera_height_m();
  bool good = enumFromWire(from.state(), FrameState::kOutOfOrder, to.state);
  good = fromWire(from.motion(), to.motion) && good;
  good = fromWire(from.floor_motion(), to.floor_motion) && good;
  good = fromWire(from.scan(), to.scan) && good;
  good = fromWire(from.appearance(), to.appearance) && good;
  return fromWire(from.boundary(), to.boundary) && good && finite(to.camera_height_m);
}

}  // namespace omnifleet::adapters
