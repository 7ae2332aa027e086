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
  return good && to.position_m.allFinite() && to.velocity_mps.allFinite() && to.covariance.allFinite() &&
         to.contact_m.allFinite() && finite(to.solidity, to.height_m, to.height_sigma_m, to.kind_probability);
}

}  // namespace

void toWire(const Objects& from, RunClock clock, v1::Objects& to) {
  to.robot(from.robot);
  fillHeader(from.acquired_ns, from.sequence, clock, to.header());
  to.state(static_cast<v1::FrameState>(from.state));
  to.camera_height_m(from.camera_height_m);
  toWire(from.motion, to.motion());
  sequenceToWire(from.tracks, 64, to.tracks(), trackToWire);
  toWire(from.scan, to.scan());
}

bool fromWire(const v1::Objects& from, Objects& to) {
  to.robot = from.robot().to_string();
  to.acquired_ns = from.header().acquired_ns();
  to.sequence = from.header().sequence_number();
  to.camera_height_m = from.camera_height_m();
  bool good = enumFromWire(from.state(), FrameState::kOutOfOrder, to.state);
  good = fromWire(from.motion(), to.motion) && good;
  good = fromWire(from.scan(), to.scan) && good;
  to.tracks.resize(from.tracks().size());
  for (std::size_t i = 0; i < to.tracks.size(); ++i)
    good = trackFromWire(from.tracks()[i], to.tracks[i]) && good;
  return good && finite(to.camera_height_m);
}

}  // namespace omnifleet::adapters
