#include "adapters/adapters.h"
#include "adapters/common.h"

namespace omnifleet::adapters {
namespace {

void vectorToWire(const FlowVector& from, v1::FlowVector& to) {
  const auto put = [](const Eigen::Vector2f& v, std::array<float, 2>& w) { w = {v.x(), v.y()}; };
  put(from.from_px, to.from_px());
  put(from.to_px, to.to_px());
  put(from.from_m, to.from_m());
  put(from.to_m, to.to_m());
  put(from.residual_m, to.residual_m());
  toWire(from.point, to.point());
}

bool vectorFromWire(const v1::FlowVector& from, FlowVector& to) {
  const auto get = [](const std::array<float, 2>& w) { return Eigen::Vector2f(w[0], w[1]); };
  to = {get(from.from_px()), get(from.to_px()),      get(from.from_m()),
        get(from.to_m()),    get(from.residual_m()), {}};
  return fromWire(from.point(), to.point) && to.from_m.allFinite() && to.to_m.allFinite() &&
         to.residual_m.allFinite();
}

void observationToWire(const ObjectObservation& from, v1::ObjectObservation& to) {
  to.label(from.label);
  to.rect_px({from.rect_x_px, from.rect_y_px, from.rect_width_px, from.rect_height_px});
  toWire(from.hull_m, to.hull());
  to.centroid(point(from.centroid_m));
  to.contact(point(from.contact_m));
  toWire(from.supports, to.support());
  to.solidity(static_cast<float>(from.solidity));
  to.truncated(from.truncated);
  to.height_m(static_cast<float>(from.height_m));
  to.height_sigma_m(static_cast<float>(from.height_sigma_m));
  sequenceToWire(from.vectors, 256, to.vectors(), vectorToWire);
}

bool observationFromWire(const v1::ObjectObservation& from, ObjectObservation& to) {
  to.label = from.label();
  to.rect_x_px = from.rect_px()[0];
  to.rect_y_px = from.rect_px()[1];
  to.rect_width_px = from.rect_px()[2];
  to.rect_height_px = from.rect_px()[3];
  bool good = fromWire(from.hull(), to.hull_m);
  to.centroid_m = point(from.centroid());
  to.contact_m = point(from.contact());
  fromWire(from.support(), to.supports);
  to.solidity = from.solidity();
  to.truncated = from.truncated();
  to.height_m = from.height_m();
  to.height_sigma_m = from.height_sigma_m();
  to.vectors.resize(from.vectors().size());
  for (std::size_t i = 0; i < to.vectors.size(); ++i)
    good = vectorFromWire(from.vectors()[i], to.vectors[i]) && good;
  return good && to.centroid_m.allFinite() && to.contact_m.allFinite() &&
         finite(to.solidity, to.height_m, to.height_sigma_m);
}

}  // namespace

void toWire(const LocalMap& from, RunClock clock, v1::LocalMap& to) {
  frameToWire(from, clock, to);
  sequenceToWire(from.objects, 64, to.objects(), observationToWire);
}

bool fromWire(const v1::LocalMap& from, LocalMap& to) {
  bool good = frameFromWire(from, to);
  to.objects.resize(from.objects().size());
  for (std::size_t i = 0; i < to.objects.size(); ++i)
    good = observationFromWire(from.objects()[i], to.objects[i]) && good;
  return good || invalidFrame(to);
}

}  // namespace omnifleet::adapters
