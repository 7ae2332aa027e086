#include "adapters/common.h"

#include <chrono>

#include "adapters/adapters.h"

namespace omnifleet::adapters {

namespace {
constexpr std::size_t kMaxRays = 1440;
constexpr std::size_t kMaxDirections = 96;
constexpr std::size_t kMaxHull = 96;
}  // namespace

void fillHeader(TimeNs acquired_ns, std::uint32_t sequence, RunClock clock, v1::Header& header) {
  header.acquired_ns(acquired_ns);
  header.published_ns(std::chrono::duration_cast<std::chrono::nanoseconds>(
                          std::chrono::system_clock::now().time_since_epoch())
                          .count());
  header.clock(static_cast<v1::Clock>(clock));
  header.sequence_number(sequence);
}

void toWire(const ScenePoint& from, v1::ScenePoint& to) {
  to.position_m({from.point_m.x(), from.point_m.y(), from.point_m.z()});
  to.sigma_m(from.sigma_m);
}

bool fromWire(const v1::ScenePoint& from, ScenePoint& to) {
  to.point_m = {from.position_m()[0], from.position_m()[1], from.position_m()[2]};
  to.sigma_m = from.sigma_m();
  return to.point_m.allFinite() && finite(to.sigma_m);
}

void toWire(const Motion& from, v1::Motion& to) {
  to.valid(from.valid);
  to.since_ns(from.since_ns);
  to.previous_from_current(pose(from.previous_from_current));
  matrixToWire<3>(from.covariance, to.covariance());
  to.left_m(from.left_m);
  to.right_m(from.right_m);
  to.wheels_rejected(from.wheels_rejected);
}

bool fromWire(const v1::Motion& from, Motion& to) {
  to.valid = from.valid();
  to.since_ns = from.since_ns();
  to.previous_from_current = pose(from.previous_from_current());
  to.covariance = matrixFromWire<3>(from.covariance());
  to.left_m = from.left_m();
  to.right_m = from.right_m();
  to.wheels_rejected = from.wheels_rejected();
  return to.previous_from_current.isFinite() && to.covariance.allFinite() && finite(to.left_m, to.right_m);
}

void toWire(const FloorMotion& from, v1::FloorMotion& to) {
  to.valid(from.valid);
  to.since_ns(from.since_ns);
  to.previous_from_current(pose(from.previous_from_current));
  matrixToWire<3>(from.covariance, to.covariance());
}

bool fromWire(const v1::FloorMotion& from, FloorMotion& to) {
  to.valid = from.valid();
  to.since_ns = from.since_ns();
  to.previous_from_current = pose(from.previous_from_current());
  to.covariance = matrixFromWire<3>(from.covariance());
  return to.previous_from_current.isFinite() && to.covariance.allFinite();
}

void toWire(const Scan& from, v1::Scan& to) {
  const std::size_t n = std::min(from.range_m.size(), kMaxRays);
  to.origin(point(from.origin_m));
  to.blind_m(from.blind_m);
  to.range_m().assign(from.range_m.begin(), from.range_m.begin() + static_cast<std::ptrdiff_t>(n));
  to.sigma_m().assign(from.sigma_m.begin(), from.sigma_m.begin() + static_cast<std::ptrdiff_t>(n));
  to.label().resize(n);
  for (std::size_t i = 0; i < n; ++i) to.label()[i] = static_cast<std::uint8_t>(from.label[i]);
  to.object().assign(from.object.begin(), from.object.begin() + static_cast<std::ptrdiff_t>(n));
}

bool fromWire(const v1::Scan& from, Scan& to) {
  const std::size_t n = from.range_m().size();
  if (from.sigma_m().size() != n || from.label().size() != n || from.object().size() != n) return false;
  to.origin_m = point(from.origin());
  to.blind_m = from.blind_m();
  to.range_m = from.range_m();
  to.sigma_m = from.sigma_m();
  to.object = from.object();
  to.label.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    if (!enumFromWire(from.label()[i], RayLabel::kBeyond, to.label[i])) return false;
    if (to.label[i] != RayLabel::kInvalid && !finite(to.range_m[i], to.sigma_m[i])) return false;
  }
  return to.origin_m.allFinite() && finite(to.blind_m);
}

void toWire(const Boundary& from, v1::Boundary& to) {
  const auto n = static_cast<std::ptrdiff_t>(std::min(from.inverse_m.size(), kMaxRays));
  to.origin(point(from.origin_m));
  to.inverse_m().assign(from.inverse_m.begin(), from.inverse_m.begin() + n);
  to.sigma().assign(from.sigma.begin(), from.sigma.begin() + n);
  to.moving().assign(from.moving.begin(),
                     from.moving.begin() + std::min(n, static_cast<std::ptrdiff_t>(from.moving.size())));
}

bool fromWire(const v1::Boundary& from, Boundary& to) {
  const std::size_t n = from.inverse_m().size();
  if (from.sigma().size() != n || (!from.moving().empty() && from.moving().size() != n)) return false;
  to.origin_m = point(from.origin());
  to.inverse_m = from.inverse_m();
  to.sigma = from.sigma();
  to.moving = from.moving();
  for (std::size_t i = 0; i < n; ++i)
    if (!finite(to.inverse_m[i], to.sigma[i])) return false;
  return to.origin_m.allFinite();
}

void toWire(const SupportFunction& from, v1::Supports& to) {
  const auto n = static_cast<std::ptrdiff_t>(std::min(from.size(), kMaxDirections));
  to.b_m().assign(from.b_m.begin(), from.b_m.begin() + n);
  to.sigma_m().assign(from.sigma_m.begin(), from.sigma_m.begin() + n);
}

void fromWire(const v1::Supports& from, SupportFunction& to) {
  to.b_m = from.b_m();
  to.sigma_m = from.sigma_m();
  to.sigma_m.resize(to.b_m.size(), 0.0F);
  for (std::size_t k = 0; k < to.b_m.size(); ++k) {
    if (!finite(to.b_m[k], to.sigma_m[k])) to.b_m[k] = to.sigma_m[k] = 0.0F;  // marks the direction as unused
  }
}

void toWire(const Polygon& from, std::vector<v1::Point2>& to) {
  sequenceToWire(from, kMaxHull, to, [](const Eigen::Vector2d& p, v1::Point2& w) { w = point(p); });
}

bool fromWire(const std::vector<v1::Point2>& from, Polygon& to) {
  to.resize(from.size());
  bool good = true;
  for (std::size_t i = 0; i < from.size(); ++i) {
    to[i] = point(from[i]);
    good = good && to[i].allFinite();
  }
  return good;
}

}  // namespace omnifleet::adapters
