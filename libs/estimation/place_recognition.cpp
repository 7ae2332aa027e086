#include "estimation/place_recognition.h"

#include <algorithm>
#include <cmath>

#include "appearance/signature.h"
#include "appearance/stored_signature.h"

namespace omnifleet::estimation {
namespace {

constexpr double kSigmas = 3.0;         // of the compass' answer: its reach
constexpr std::size_t kNeighbours = 8;  // places in a row that may look alike for each that is wanted

const Place& placeOf(const PlaceRecognition::Scope& scope, const PlaceIndex::Entry& entry) {
  return scope.memories[entry.robot]->places()[entry.index];
}

}  // namespace

PlaceRecognitionOptions PlaceRecognitionOptions::read(const options::Section& section) {
  using options::kPositive;
  PlaceRecognitionOptions o;
  section.read("use", o.use);
  section.read("most", o.most, {0, 100});
  section.read("reach_m", o.reach_m, kPositive);
  section.read("reach_rad", o.reach_rad, kPositive);
  section.read("least_confidence", o.least_confidence, {0.0, 1.0});
  o.database = appearance::PlaceDatabaseOptions::read(section.child("database"));
  o.compass = appearance::CompassOptions::read(section.child("compass"));
  section.finish();
  return o;
}

bool PlaceRecognition::counts(const Scope& scope, const PlaceIndex::Entry& entry) {
  const PlaceMemory& memory = *scope.memories[entry.robot];
  const auto keyframe = memory.keyframe(entry.index);
  return keyframe && std::binary_search(scope.keyframes.begin(), scope.keyframes.end(), *keyframe) &&
         (entry.robot != scope.robot || memory.places()[entry.index].acquired_ns <= scope.before_ns);
}

void PlaceRecognition::update(const std::vector<const PlaceMemory*>& memories) {
  if (!options_.use) return;
  for (std::size_t robot = 0; robot < memories.size(); ++robot) index_.update(robot, *memories[robot]);
}

std::vector<Relocalizer::Suggestion> PlaceRecognition::suggest(const Scope& scope, const Appearance& seen) {
  std::vector<Relocalizer::Suggestion> suggestions;
  if (!options_.use) return suggestions;
  update(scope.memories);
  const auto most = static_cast<std::size_t>(options_.most);
  appearance::Compass::View view;
  bool is_prepared = false;
  std::vector<Pose2> taken;
  for (const PlaceIndex::Found& found : index_.nearest(seen.format, seen.signature, most * kNeighbours)) {
    if (suggestions.size() >= most) break;
    if (!counts(scope, found.place)) continue;
    const Place& place = placeOf(scope, found.place);
    const auto same = [&](const Pose2& other) {
      return (other.translation() - place.frame_from_base.translation()).norm() < options_.reach_m;
    };
    if (std::any_of(taken.begin(), taken.end(), same)) continue;
    if (!is_prepared) view = compass_.prepare(appearance::restore(seen.format, seen.signature));
    is_prepared = true;
    const appearance::CompassResult turn =
        compass_.compare(compass_.prepare(appearance::restore(place.format, place.signature)), view);
    Relocalizer::Suggestion suggestion{place.frame_from_base, options_.reach_m, M_PI};
    if (turn.valid && turn.confidence >= options_.least_confidence) {
      suggestion.map_from_base.theta_rad = wrapAngle(place.frame_from_base.theta_rad + turn.turn_rad);
      suggestion.reach_rad = std::min(M_PI, options_.reach_rad + kSigmas * turn.sigma_rad);
    }
    taken.push_back(place.frame_from_base);
    suggestions.push_back(suggestion);
  }
  return suggestions;
}

std::optional<PlaceIndex::Entry> PlaceRecognition::nearest(const Scope& scope,
                                                           const Pose2& map_from_base) const {
  std::optional<PlaceIndex::Entry> nearest;
  double nearest_m = options_.reach_m;
  for (std::size_t robot = 0; robot < scope.memories.size(); ++robot) {
    for (const Place& place : scope.memories[robot]->places()) {
      const double distance_m = (place.frame_from_base.translation() - map_from_base.translation()).norm();
      if (distance_m >= nearest_m || !counts(scope, {robot, place.index})) continue;
      nearest = PlaceIndex::Entry{robot, place.index};
      nearest_m = distance_m;
    }
  }
  return nearest;
}

}  // namespace omnifleet::estimation
