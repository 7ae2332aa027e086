#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "appearance/compass.h"
#include "estimation/place_index.h"
#include "estimation/place_memory.h"
#include "estimation/relocalizer.h"
#include "geometry/pose2.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::estimation {

struct PlaceRecognitionOptions {
  bool use = true;                ///< similar places suggest where a robot may be
  int most = 4;                   ///< places that suggest a pose, at most
  double reach_m = 1.0;           ///< m, about a place, where the robot may be; …
  double reach_rad = 0.35;        ///< rad, … about the compass' answer, plus 3 σ
  double least_confidence = 0.5;  ///< 1, of the compass; below, all headings are searched
  appearance::PlaceDatabaseOptions database;
  appearance::CompassOptions compass;
  static PlaceRecognitionOptions read(const options::Section& section);
};

/// Recognizes places by their signatures where a robot is searched: which poses similar places suggest.
class PlaceRecognition {
 public:
  explicit PlaceRecognition(const PlaceRecognitionOptions& options = {})
      : options_(options), index_(options.database), compass_(options.compass) {}

  /// Places that may be compared.
  struct Scope {
    std::vector<const PlaceMemory*> memories;  ///< of all robots
    std::vector<KeyframeMap::Id> keyframes;    ///< ascending; places relative to others do not count
    std::size_t robot = 0;                     ///< of the frame; …
    TimeNs before_ns = 0;                      ///< … its own places count if they are not newer than this
  };

  /// Takes in the places that are new since the last call. @param memories of all robots, in their order
  void update(const std::vector<const PlaceMemory*>& memories);
  /// Poses of a frame with this appearance, by the places that look most alike.
  std::vector<Relocalizer::Suggestion> suggest(const Scope& scope, const Appearance& seen);
  /// The place in the scope that is nearest to a pose, at most reach_m away.
  std::optional<PlaceIndex::Entry> nearest(const Scope& scope, const Pose2& map_from_base) const;

  /// See PlaceIndex.
  std::vector<PlaceIndex::Refusal> takeRefusals() { return index_.takeRefusals(); }

 private:
  static bool counts(const Scope& scope, const PlaceIndex::Entry& entry);

  PlaceRecognitionOptions options_;
  PlaceIndex index_;
  appearance::Compass compass_;
};

}  // namespace omnifleet::estimation
