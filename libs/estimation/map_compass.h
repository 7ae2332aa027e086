#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "appearance/compass.h"
#include "estimation/place_memory.h"
#include "geometry/pose2.h"
#include "options/options.h"

namespace omnifleet::estimation {

struct MapCompassOptions {
  bool use = true;
  double reach_m = 0.5;    ///< m, between two places that are compared; most answers are right up to there
  double spacing_m = 0.3;  ///< m, between two pairs, so that they show different views
  int most_pairs = 8;
  double most_evidence = 2.0;     ///< nats, of one pair, at most
  double most_confidence = 0.98;  ///< 1, of an answer of the compass; no answer counts as more certain
  double sigma_rad = 0.01;        ///< rad, of the headings of two places in their maps
  appearance::CompassOptions compass;
  static MapCompassOptions read(const options::Section& section);
};

/// What the visual compass says about how two maps lie: the signatures of places that are near each other are
/// compared at the turn that the relation gives (compassEvidence()). In a symmetric room the surfaces fit in
/// several ways, the images in one.
class MapCompass {
 public:
  using Memories = std::vector<const PlaceMemory*>;

  explicit MapCompass(const MapCompassOptions& options) : options_(options), compass_(options.compass) {}

  struct Opinion {
    int pairs = 0;
    double evidence = 0.0;  ///< nats, sum over the pairs: > 0 for the relation, < 0 against it
  };
  /// @param map places of the others @param own places of the robot @param sigma_rad of the relation
  Opinion ask(const Memories& map, const PlaceMemory& own, const Pose2& map_from_own, double sigma_rad);

 private:
  const appearance::Compass::View& viewOf(const Place& place);

  MapCompassOptions options_;
  appearance::Compass compass_;
  std::map<std::pair<std::string, std::uint32_t>, appearance::Compass::View> views_;  ///< by robot and index
};

}  // namespace omnifleet::estimation
