#include "local_mapper/persistent_places.h"

#include <algorithm>

#include "geometry/polygon.h"

namespace omnifleet::local_mapper {
namespace {

constexpr std::size_t kMost = 256;  // places; a floor full of patterns has many
constexpr double kGate_m = 0.2;     // the beginning of a region varies from frame to frame
constexpr int kForgotten = 50;      // frames after which an unseen place is dropped
constexpr int kFew = 3;             // minimum number of frames; fewer are noise

}  // namespace

PersistentPlaces::PersistentPlaces() {
  places_.reserve(kMost);
  reported_m_.reserve(kMost);
}

void PersistentPlaces::take(const Motion& motion, const std::vector<Eigen::Vector2d>& undecided_m,
                            const std::vector<ObjectObservation>& objects) {
  const Pose2 current_from_previous = motion.valid ? motion.previous_from_current.inverse() : Pose2{};
  for (Place& place : places_) {
    place.at_m = current_from_previous * place.at_m;
    ++place.frames;
    ++place.unseen;
  }
  for (const Eigen::Vector2d& at : undecided_m) {
    const auto distance = [&](const Place& place) { return (place.at_m - at).norm(); };
    const auto nearest =
        std::min_element(places_.begin(), places_.end(),
                         [&](const Place& a, const Place& b) { return distance(a) < distance(b); });
    if (nearest != places_.end() && distance(*nearest) < kGate_m) {
      nearest->seen += nearest->unseen > 0 ? 1 : 0;  // once per frame
      nearest->unseen = 0;
      nearest->at_m = at;
    } else if (places_.size() < kMost) {
      places_.push_back({at, 1, 1, 0, 0, false});
    }
  }
  for (Place& place : places_) {
    const bool is_occupied =
        place.unseen > 0 && std::any_of(objects.begin(), objects.end(), [&](const ObjectObservation& o) {
          return contains(o.hull_m, place.at_m) || (o.contact_m - place.at_m).norm() < kGate_m;
        });
    place.occupied += is_occupied ? 1 : 0;
  }
  const auto isOver = [](const Place& place) {
    return place.unseen > kForgotten || place.occupied >= place.seen;
  };
  places_.erase(std::remove_if(places_.begin(), places_.end(), isOver), places_.end());
}

const std::vector<Eigen::Vector2d>& PersistentPlaces::toReport(bool ended) {
  reported_m_.clear();
  for (Place& place : places_) {
    const bool is_persistent =
        place.seen >= kPersistent || (ended && place.seen >= kFew && 2 * place.seen >= place.frames);
    if (!is_persistent || place.is_reported) continue;
    place.is_reported = true;
    reported_m_.push_back(place.at_m);
  }
  return reported_m_;
}

}  // namespace omnifleet::local_mapper
