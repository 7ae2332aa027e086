#include "adapters/adapters.h"
#include "adapters/common.h"

namespace omnifleet::adapters {
namespace {

std::array<std::int32_t, 2> pointToWire(const occupancy::PointDmm& from) {
  return {from.x_dmm, from.y_dmm};
}
occupancy::PointDmm pointFromWire(const std::array<std::int32_t, 2>& from) {
  return {from[0], from[1]};
}

void viewToWire(const occupancy::SupportView& from, v1::SupportView& to) {
  to.track_id(from.track_id);
  to.kind(static_cast<std::uint8_t>(from.kind));
  to.truncated(from.truncated);
  to.solidity_permille(from.solidity_permille);
  to.position(pointToWire(from.position));
  to.contact(pointToWire(from.contact));
  to.b(from.b_dmm);
  to.sigma(from.sigma_dmm);
  to.height(from.height_dmm);
  to.height_sigma(from.height_sigma_dmm);
  to.name(from.name);
}

bool viewFromWire(const v1::SupportView& from, occupancy::SupportView& to) {
  to.track_id = from.track_id();
  to.truncated = from.truncated();
  to.solidity_permille = from.solidity_permille();
  to.position = pointFromWire(from.position());
  to.contact = pointFromWire(from.contact());
  to.b_dmm = from.b();
  to.sigma_dmm = from.sigma();
  to.height_dmm = from.height();
  to.height_sigma_dmm = from.height_sigma();
  to.name = from.name().to_string();
  return enumFromWire(from.kind(), ObjectKind::kRobot, to.kind) && to.b_dmm.size() == to.sigma_dmm.size();
}

void surfacePointToWire(const occupancy::SurfacePoint& from, v1::SurfacePoint& to) {
  to.track(from.track);
  to.position({from.x_dmm, from.y_dmm, from.z_dmm});
  to.sigma(from.sigma_dmm);
}

}  // namespace

void toWire(const occupancy::Contribution& from, RunClock clock, v1::Contribution& to) {
  to.robot(from.robot);
  fillHeader(from.acquired_ns, from.sequence, clock, to.header());
  to.camera_height(from.camera_height_dmm);
  to.scan_origin(pointToWire(from.scan_origin));
  to.range(from.range_dmm);
  to.sigma(from.sigma_dmm);
  to.label().resize(from.label.size());
  for (std::size_t i = 0; i < from.label.size(); ++i)
    to.label()[i] = static_cast<std::uint8_t>(from.label[i]);
  to.object(from.object);
  sequenceToWire(from.views, 64, to.views(), viewToWire);
  sequenceToWire(from.points, occupancy::Contribution::kMaxPoints, to.points(), surfacePointToWire);
}

bool fromWire(const v1::Contribution& from, occupancy::Contribution& to) {
  to.robot = from.robot().to_string();
  to.acquired_ns = from.header().acquired_ns();
  to.sequence = from.header().sequence_number();
  to.camera_height_dmm = from.camera_height();
  to.scan_origin = pointFromWire(from.scan_origin());
  to.range_dmm = from.range();
  to.sigma_dmm = from.sigma();
  to.object = from.object();
  to.label.resize(from.label().size());
  bool good = to.label.size() == to.range_dmm.size() && to.object.size() == to.range_dmm.size() &&
              (to.sigma_dmm.empty() || to.sigma_dmm.size() == to.range_dmm.size());
  for (std::size_t i = 0; i < to.label.size(); ++i) {
    good = enumFromWire(from.label()[i], RayLabel::kBeyond, to.label[i]) && good;
  }
  to.views.resize(from.views().size());
  for (std::size_t i = 0; i < to.views.size(); ++i) good = viewFromWire(from.views()[i], to.views[i]) && good;
  to.points.clear();
  for (const auto& point : from.points()) {
    const auto& [x, y, z] = point.position();
    to.points.push_back({point.track(), x, y, z, point.sigma()});
  }
  return good;
}

void toWire(const occupancy::KeyframePose& from, RunClock clock, v1::KeyframePose& to) {
  to.robot(from.robot);
  fillHeader(from.acquired_ns, from.sequence, clock, to.header());
  to.term(from.term);
  to.revision(from.revision);
  to.valid(from.valid);
  to.frame(from.frame);
  to.position(pointToWire(from.position));
  to.theta(from.theta_dmrad);
  to.sigma({from.sigma_dmm, from.sigma_dmrad});
  sequenceToWire(from.sightings, 32, to.sightings(), [](const Sighting& s, v1::SightedRobot& w) {
    w.track_id(s.track_id);
    w.robot(s.robot);
  });
  to.camera_error(from.camera_error);
}

bool fromWire(const v1::KeyframePose& from, occupancy::KeyframePose& to) {
  to.robot = from.robot().to_string();
  to.acquired_ns = from.header().acquired_ns();
  to.sequence = from.header().sequence_number();
  to.term = from.term();
  to.revision = from.revision();
  to.valid = from.valid();
  to.frame = from.frame().to_string();
  to.position = pointFromWire(from.position());
  to.theta_dmrad = from.theta();
  to.sigma_dmm = from.sigma()[0];
  to.sigma_dmrad = from.sigma()[1];
  to.sightings.resize(from.sightings().size());
  for (std::size_t i = 0; i < to.sightings.size(); ++i) {
    to.sightings[i] = {from.sightings()[i].track_id(), from.sightings()[i].robot().to_string()};
  }
  to.camera_error = from.camera_error();
  return true;
}

void toWire(const occupancy::Have& from, v1::Have& to) {
  to.replica(from.replica);
  to.ending(from.ending);
  sequenceToWire(from.ranges, 256, to.ranges(), [](const occupancy::HeldRange& r, v1::HeldRange& w) {
    w.robot(r.robot);
    w.kind(static_cast<std::uint8_t>(r.kind));
    w.first_ns(r.first_ns);
    w.last_ns(r.last_ns);
    w.count(r.count);
    w.digest(r.digest);
  });
}

bool fromWire(const v1::Have& from, occupancy::Have& to) {
  to.replica = from.replica().to_string();
  to.ending = from.ending();
  to.ranges.resize(from.ranges().size());
  bool good = true;
  for (std::size_t i = 0; i < to.ranges.size(); ++i) {
    const v1::HeldRange& w = from.ranges()[i];
    occupancy::HeldRange& r = to.ranges[i];
    r = {w.robot().to_string(), {}, w.first_ns(), w.last_ns(), w.count(), w.digest()};
    good = enumFromWire(w.kind(), occupancy::SampleKind::kKeyframePose, r.kind) && r.first_ns <= r.last_ns &&
           good;
  }
  return good;
}

}  // namespace omnifleet::adapters
