#include "adapters/adapters.h"
#include "adapters/common.h"

namespace omnifleet::adapters {

void toWire(const PoseEstimate& from, RunClock clock, std::uint32_t term, v1::Pose& to) {
  to.robot(from.robot);
  fillHeader(from.acquired_ns, from.sequence, clock, to.header());
  to.valid(from.valid);
  to.frame(from.frame);
  to.map_from_base(pose(from.map_from_base));
  matrixToWire<3>(from.covariance, to.covariance());
  sequenceToWire(from.sightings, 32, to.sightings(), [](const Sighting& s, v1::Sighting& w) {
    w.track_id(s.track_id);
    w.robot(s.robot);
  });
  to.term(term);
  const Eigen::Vector4d& e = from.camera_error;
  to.camera_error({e(0), e(1), e(2), e(3)});
  to.datum(from.datum);
  to.state(static_cast<v1::LocalizationState>(from.state));
  to.event(static_cast<v1::PoseEvent>(from.event));
  to.correction_sigmas(from.correction_sigmas);
  to.sources_used(from.used.bits);
  to.sources_rejected(from.rejected.bits);
}

bool fromWire(const v1::Pose& from, PoseEstimate& to) {
  to.robot = from.robot().to_string();
  to.acquired_ns = from.header().acquired_ns();
  to.sequence = from.header().sequence_number();
  to.valid = from.valid();
  to.frame = from.frame().to_string();
  to.map_from_base = pose(from.map_from_base());
  to.covariance = matrixFromWire<3>(from.covariance());
  to.datum = from.datum();
  to.sightings.resize(from.sightings().size());
  for (std::size_t i = 0; i < to.sightings.size(); ++i) {
    to.sightings[i] = {from.sightings()[i].track_id(), from.sightings()[i].robot().to_string()};
  }
  to.camera_error = Eigen::Map<const Eigen::Vector4d>(from.camera_error().data());
  to.correction_sigmas = from.correction_sigmas();
  to.used.bits = from.sources_used();
  to.rejected.bits = from.sources_rejected();
  const bool known = to.used.isKnown() && to.rejected.isKnown() &&
                     enumFromWire(from.state(), LocalizationState::kRelocalized, to.state) &&
                     enumFromWire(from.event(), PoseEvent::kGap, to.event);
  if (known && finite(to.correction_sigmas) && to.map_from_base.isFinite() && to.covariance.allFinite() &&
      to.camera_error.allFinite())
    return true;
  to.valid = false;
  to.state = LocalizationState::kUnlocated;
  to.event = PoseEvent::kNone;
  to.correction_sigmas = 0.0;
  to.used = to.rejected = {};
  to.camera_error.setZero();
  to.map_from_base = Pose2();
  to.covariance.setIdentity();
  to.sightings.clear();
  return false;
}

void toWire(const std::string& source, TimeNs acquired_ns, std::uint32_t sequence, FrameState state,
            const std::vector<Measurement>& from, RunClock clock, v1::Measurement& to) {
  to.source(source);
  fillHeader(acquired_ns, sequence, clock, to.header());
  to.state(static_cast<v1::FrameState>(state));
  sequenceToWire(from, 64, to.values(), [](const Measurement& m, v1::MeasurementValue& w) {
    w.kind(static_cast<v1::MeasurementKind>(m.kind));
    w.from_name(m.from);
    w.to_name(m.to);
    w.from_ns(m.from_ns);
    w.value({m.value.x(), m.value.y(), m.value.z()});
    matrixToWire<3>(m.covariance, w.covariance());
  });
}

bool fromWire(const v1::Measurement& from, std::vector<Measurement>& to) {
  to.resize(from.values().size());
  bool good = true;
  for (std::size_t i = 0; i < to.size(); ++i) {
    const v1::MeasurementValue& w = from.values()[i];
    Measurement& m = to[i];
    m.source = from.source().to_string();
    m.sequence = from.header().sequence_number();
    m.acquired_ns = from.header().acquired_ns();
    m.from = w.from_name().to_string();
    m.to = w.to_name().to_string();
    m.from_ns = w.from_ns();
    m.value = {w.value()[0], w.value()[1], w.value()[2]};
    m.covariance = matrixFromWire<3>(w.covariance());
    good = enumFromWire(w.kind(), MeasurementKind::kPosition, m.kind) && good && m.value.allFinite() &&
           m.covariance.allFinite();
  }
  return good;
}

}  // namespace omnifleet::adapters
