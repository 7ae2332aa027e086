#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "appearance/place_database.h"
#include "estimation/place_memory.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::estimation {

/// The places of all robots of an estimator by what they look like. Places are compared only with places of
/// the same SignatureFormat.
class PlaceIndex {
 public:
  explicit PlaceIndex(const appearance::PlaceDatabaseOptions& options = {}) : options_(options) {}

  struct Entry {
    std::size_t robot = 0;    ///< as given to update()
    std::uint32_t index = 0;  ///< of the robot's places
  };
  struct Found {
    Entry place;
    double distance = 0.0;  ///< of the signatures, see appearance::PlaceDatabase
  };

  /// Takes in the places of a robot that are new since the last call.
  void update(std::size_t robot, const PlaceMemory& memory);

  /// At most `count` places, the most alike first. None if no place has the signature's format, or if the
  /// signature does not fit its format.
  std::vector<Found> nearest(const SignatureFormat& format, const StoredSignature& signature,
                             std::size_t count);

  std::size_t size() const;
  /// A robot whose places are not compared with those of the robots before it.
  struct Refusal {
    std::string robot, why;
    bool operator==(const Refusal& o) const { return robot == o.robot && why == o.why; }
  };
  /// Each one once. Empty: nothing new.
  std::vector<Refusal> takeRefusals();

 private:
  struct Shelf {
    appearance::PlaceDatabase database;
    std::vector<Entry> entries;  ///< by the index in the database
  };
  Shelf* find(const SignatureFormat& format);

  appearance::PlaceDatabaseOptions options_;
  std::vector<std::size_t> taken_;  ///< places per robot
  std::vector<Shelf> shelves_;      ///< one per format
  void refuse(const std::string& robot, const std::string& why);

  std::vector<Refusal> refusals_, refused_;
};

}  // namespace omnifleet::estimation
