#include "adapters/adapters.h"
#include "adapters/common.h"

namespace omnifleet::adapters {
namespace {

void trackToWire(const Track& from, v1::Track& to) {
  to.id(from.id);
  to.kind(static_cast<v1::ObjectKind>(from.kind));
  to.kind_probability(static_cast<float>(from.kind_probability));
  to.visible(from.visible);
  to.position(point(from.position_m));
  to.velocity(point(from.velocity_mps));
  matrixToWire<2>(from.covariance, to.covariance());
  to.contact(point(from.contact_m));
  toWire(from.hull_m, to.hull());
  toWire(from.supports, to.support());
  to.solidity(static_cast<float>(from.solidity));
  to.truncated(from.truncated);
  to.height_m(static_cast<float>(from.height_m));
  to.height_sigma_m(static_cast<float>(from.height_sigma_m));
  sequenceToWire(from.points, 64, to.points(), [](const ScenePoint& p, v1::ScenePoint& w) { toWire(p, w); });
  to.name(from.name);
}

bool trackFromWire(const v1::Track& from, Track& to) {
  to.id = from.id();
  bool good = enumFromWire(from.kind(), ObjectKind::kRobot, to.kind);
  to.kind_probability = from.kind_probability();
  to.visible = from.visible();
  to.position_m = point(from.position());
  to.velocity_mps = point(from.velocity());
  to.covariance = matrixFromWire<2>(from.covariance());
  to.contact_m = point(from.contact());
  good = fromWire(from.hull(), to.hull_m) && good;
  fromWire(from.support(), to.supports);
  to.solidity = from.solidity();
  to.truncated = from.truncated();
  to.height_m = from.height_m();
  to.height_sigma_m = from.height_sigma_m();
  to.points.resize(from.points().size());
  for (std::size_t i = 0; i < to.points.size(); ++i) good = fromWire(from.points()[i], to.points[i]) && good;
  to.name = from.name().to_string();
  return good && to.position_m.allFinite() && to.velocity_mps.allFinite() && to.covariance.allFinite() &&
         to.contact_m.allFinite() && finite(to.solidity, to.height_m, to.height_sigma_m, to.kind_probability);
}

}  // namespace

bool fromWire(const v1::WheelOdometry& from, dataset::WheelRow& to) {
  to = {from.header().acquired_ns(), from.v_left_mps(), from.v_right_mps()};
  return std::abs(to.left_mps) <= dataset::kMaxWheelSpeedMps &&
         std::abs(to.right_mps) <= dataset::kMaxWheelSpeedMps;  // false for NaN as well
}

void toWire(const Objects& from, RunClock clock, v1::Objects& to) {
  frameToWire(from, clock, to);
  sequenceToWire(from.tracks, 64, to.tracks(), trackToWire);
}

bool fromWire(const v1::Objects& from, Objects& to) {
  bool good = frameFromWire(from, to);
  to.tracks.resize(from.tracks().size());
  for (std::size_t i = 0; i < to.tracks.size(); ++i)
    good = trackFromWire(from.tracks()[i], to.tracks[i]) && good;
  return good || invalidFrame(to);
}

}  // namespace omnifleet::adapters
