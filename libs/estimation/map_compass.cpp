#include "estimation/map_compass.h"

#include <algorithm>
#include <cmath>

#include "appearance/signature.h"
#include "appearance/stored_signature.h"
#include "estimation/compass_evidence.h"

namespace omnifleet::estimation {
namespace {

constexpr std::size_t kMostViews = 512;  // kept, of some 10 kB each

struct PlacePair {
  const Place *own, *other;
  double distance_m;
};

bool areComparable(const Place& a, const Place& b) {
  return appearance::whyIncomparable(a.format, b.format).empty() &&
         appearance::whyMalformed(b.format, b.signature).empty();
}

/// For each place of the robot the nearest one of the others, the nearest pairs first.
std::vector<PlacePair> nearPairs(const MapCompass::Memories& map, const PlaceMemory& own,
                                 const Pose2& map_from_own, double reach_m) {
  std::vector<PlacePair> pairs;
  for (const Place& place : own.places()) {
    if (!appearance::whyMalformed(place.format, place.signature).empty()) continue;
    const Eigen::Vector2d at = map_from_own * place.frame_from_base.translation();
    PlacePair nearest{&place, nullptr, reach_m};
    for (const PlaceMemory* memory : map) {
      for (const Place& other : memory->places()) {
        const double distance_m = (other.frame_from_base.translation() - at).norm();
        if (distance_m > nearest.distance_m || !areComparable(place, other)) continue;
        nearest.other = &other;
        nearest.distance_m = distance_m;
      }
    }
    if (nearest.other != nullptr) pairs.push_back(nearest);
  }
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const PlacePair& a, const PlacePair& b) { return a.distance_m < b.distance_m; });
  return pairs;
}

}  // namespace

MapCompassOptions MapCompassOptions::read(const options::Section& section) {
  MapCompassOptions o;
  section.read("use", o.use);
  section.read("reach_m", o.reach_m, options::kPositive);
  section.read("spacing_m", o.spacing_m, options::kNotNegative);
  section.read("most_pairs", o.most_pairs, {1, 1000});
  section.read("most_evidence", o.most_evidence, options::kNotNegative);
  section.read("most_confidence", o.most_confidence, {0.0, 1.0 - 1e-6});
  section.read("sigma_rad", o.sigma_rad, options::kPositive);
  o.compass = appearance::CompassOptions::read(section.child("method"));
  section.finish();
  return o;
}

const appearance::Compass::View& MapCompass::viewOf(const Place& place) {
  const auto [entry, added] = views_.try_emplace({place.robot, place.index});
  if (added) compass_.prepare(appearance::restore(place.format, place.signature), entry->second);
  return entry->second;
}

MapCompass::Opinion MapCompass::ask(const Memories& map, const PlaceMemory& own, const Pose2& map_from_own,
                                    double sigma_rad) {
  Opinion opinion;
  if (!options_.use) return opinion;
  if (views_.size() > kMostViews) views_.clear();
  std::vector<Eigen::Vector2d> taken;
  for (const PlacePair& pair : nearPairs(map, own, map_from_own, options_.reach_m)) {
    if (opinion.pairs == options_.most_pairs) break;
    const Pose2 own_pose = pair.own->frame_from_base;
    const auto near = [&](const Eigen::Vector2d& other) {
      return (other - own_pose.translation()).norm() < options_.spacing_m;
    };
    if (std::any_of(taken.begin(), taken.end(), near)) continue;
    taken.push_back(own_pose.translation());
    const Pose2 from_to = pair.other->frame_from_base.inverse() * map_from_own * own_pose;
    const appearance::CompassResult answer =
        compass_.compare(viewOf(*pair.other), viewOf(*pair.own), hintOf(from_to));
    ++opinion.pairs;
    opinion.evidence += std::min(
        options_.most_evidence,
        compassEvidence(answer, from_to.theta_rad, std::hypot(sigma_rad, std::sqrt(2.0) * options_.sigma_rad),
                        options_.most_confidence));
  }
  return opinion;
}

}  // namespace omnifleet::estimation
