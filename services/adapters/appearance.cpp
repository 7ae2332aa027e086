#include "adapters/adapters.h"
#include "adapters/common.h"

namespace omnifleet::adapters {
namespace {

constexpr std::size_t kMostBytes = 4096, kMostRows = 64, kMostLinks = 16, kMostReason = 128;

void formatToWire(const SignatureFormat& from, v1::SignatureFormat& to) {
  to.rows(from.rows);
  to.columns(from.columns);
  to.stored_rows(from.stored_rows);
  to.stored_modules(from.stored_modules);
  to.stored_phases(from.stored_phases);
  to.least_elevation_rad(from.least_elevation_rad);
  to.most_elevation_rad(from.most_elevation_rad);
  to.camera(from.camera.substr(0, 64));
}

bool formatFromWire(const v1::SignatureFormat& from, SignatureFormat& to) {
  to.rows = from.rows();
  to.columns = from.columns();
  to.stored_rows = from.stored_rows();
  to.stored_modules = from.stored_modules();
  to.stored_phases = from.stored_phases();
  to.least_elevation_rad = from.least_elevation_rad();
  to.most_elevation_rad = from.most_elevation_rad();
  to.camera = from.camera().to_string();
  return finite(to.least_elevation_rad, to.most_elevation_rad);
}

template <typename Wire>
void signatureToWire(const StoredSignature& from, Wire& to) {
  to.signature().assign(from.bytes.begin(), from.bytes.begin() + static_cast<std::ptrdiff_t>(std::min(
                                                                     from.bytes.size(), kMostBytes)));
  to.scale().assign(from.scale.begin(),
                    from.scale.begin() + static_cast<std::ptrdiff_t>(std::min(from.scale.size(), kMostRows)));
}

/// A signature is empty or as long as its format says.
template <typename Wire>
bool signatureFromWire(const Wire& from, const SignatureFormat& format, StoredSignature& to) {
  to.bytes = from.signature();
  to.scale = from.scale();
  if (to.bytes.empty() && to.scale.empty()) return true;
  const auto row = static_cast<std::size_t>(format.stored_modules) + format.stored_phases;
  return to.scale.size() == format.stored_rows && to.bytes.size() == to.scale.size() * row &&
         std::all_of(to.scale.begin(), to.scale.end(), [](float s) { return finite(s) && s >= 0; });
}

}  // namespace

void toWire(const Appearance& from, v1::Appearance& to) {
  to.since_ns(from.since_ns);
  to.turn_rad(from.turn_rad);
  to.turn_sigma_rad(from.turn_sigma_rad);
  to.confidence(from.confidence);
  to.difference(from.difference);
  formatToWire(from.format, to.format());
  signatureToWire(from.signature, to);
}

bool fromWire(const v1::Appearance& from, Appearance& to) {
  to.since_ns = from.since_ns();
  to.turn_rad = from.turn_rad();
  to.turn_sigma_rad = from.turn_sigma_rad();
  to.confidence = from.confidence();
  to.difference = from.difference();
  const bool good = formatFromWire(from.format(), to.format);
  return signatureFromWire(from, to.format, to.signature) && good &&
         finite(to.turn_rad, to.turn_sigma_rad, to.confidence, to.difference);
}

void toWire(const Place& from, RunClock clock, v1::Place& to) {
  to.robot(from.robot);
  to.index(from.index);
  fillHeader(from.acquired_ns, from.sequence, clock, to.header());
  to.frame(from.frame);
  to.frame_from_base(pose(from.frame_from_base));
  matrixToWire<3>(from.covariance, to.covariance());
  to.metric(from.metric);
  formatToWire(from.format, to.format());
  signatureToWire(from.signature, to);
  sequenceToWire(from.links, kMostLinks, to.links(), [](const PlaceLink& l, v1::PlaceLink& w) {
    w.kind(l.closes_loop ? v1::LINK_LOOP : v1::LINK_CONSECUTIVE);
    w.robot(l.robot);
    w.index(l.index);
    w.this_from_other(pose(l.this_from_other));
    matrixToWire<3>(l.covariance, w.covariance());
  });
}

bool fromWire(const v1::Place& from, Place& to) {
  to.robot = from.robot().to_string();
  to.index = from.index();
  to.acquired_ns = from.header().acquired_ns();
  to.sequence = from.header().sequence_number();
  to.frame = from.frame().to_string();
  to.frame_from_base = pose(from.frame_from_base());
  to.covariance = matrixFromWire<3>(from.covariance());
  to.metric = from.metric();
  bool good = formatFromWire(from.format(), to.format);
  good = signatureFromWire(from, to.format, to.signature) && good;
  to.links.resize(from.links().size());
  for (std::size_t i = 0; i < to.links.size(); ++i) {
    const v1::PlaceLink& w = from.links()[i];
    PlaceLink& l = to.links[i];
    l.closes_loop = w.kind() == v1::LINK_LOOP;
    l.robot = w.robot().to_string();
    l.index = w.index();
    l.this_from_other = pose(w.this_from_other());
    l.covariance = matrixFromWire<3>(w.covariance());
    good = good && l.this_from_other.isFinite() && l.covariance.allFinite();
  }
  return good && to.frame_from_base.isFinite() && to.covariance.allFinite();
}

void toWire(const Alignment& from, RunClock clock, v1::Alignment& to) {
  to.robot(from.robot);
  fillHeader(from.acquired_ns, 0, clock, to.header());
  to.status(static_cast<v1::AlignmentStatus>(from.status));
  to.frame(from.frame);
  to.reason(from.reason.substr(0, kMostReason));
  to.score(from.score);
  to.map_from_frame(pose(from.map_from_frame));
  matrixToWire<3>(from.covariance, to.covariance());
}

bool fromWire(const v1::Alignment& from, Alignment& to) {
  to.robot = from.robot().to_string();
  to.acquired_ns = from.header().acquired_ns();
  to.frame = from.frame().to_string();
  to.reason = from.reason().to_string();
  to.score = from.score();
  to.map_from_frame = pose(from.map_from_frame());
  to.covariance = matrixFromWire<3>(from.covariance());
  return enumFromWire(from.status(), AlignmentStatus::kUndecided, to.status) && finite(to.score) &&
         to.map_from_frame.isFinite() && to.covariance.allFinite();
}

}  // namespace omnifleet::adapters
