#include "estimation/place_index.h"

#include <algorithm>
#include <utility>

#include "appearance/signature.h"
#include "appearance/stored_signature.h"

namespace omnifleet::estimation {

PlaceIndex::Shelf* PlaceIndex::find(const SignatureFormat& format) {
  const auto shelf = std::find_if(shelves_.begin(), shelves_.end(),
                                  [&](const Shelf& s) { return s.database.format() == format; });
  return shelf == shelves_.end() ? nullptr : &*shelf;
}

void PlaceIndex::update(std::size_t robot, const PlaceMemory& memory) {
  if (taken_.size() <= robot) taken_.resize(robot + 1, 0);
  for (; taken_[robot] < memory.places().size(); ++taken_[robot]) {
    const Place& place = memory.places()[taken_[robot]];
    if (place.signature.bytes.empty()) continue;  // the last place of a run may have none
    if (const std::string why = appearance::whyMalformed(place.format, place.signature); !why.empty()) {
      refuse(place.robot, why);
      continue;
    }
    Shelf* shelf = find(place.format);
    if (shelf == nullptr) {
      if (!shelves_.empty())
        refuse(place.robot, appearance::whyIncomparable(shelves_.front().database.format(), place.format));
      shelves_.push_back({appearance::PlaceDatabase(place.format, options_), {}});
      shelf = &shelves_.back();
    }
    shelf->database.add(place.format, place.signature);
    shelf->entries.push_back({robot, place.index});
  }
}

std::vector<PlaceIndex::Found> PlaceIndex::nearest(const SignatureFormat& format,
                                                   const StoredSignature& signature, std::size_t count) {
  std::vector<Found> found;
  Shelf* shelf = find(format);
  if (shelf == nullptr || !appearance::whyMalformed(format, signature).empty()) return found;
  for (const auto& match : shelf->database.nearest(format, signature, count))
    found.push_back({shelf->entries[match.index], match.distance});
  return found;
}

std::size_t PlaceIndex::size() const {
  std::size_t sum = 0;
  for (const Shelf& shelf : shelves_) sum += shelf.entries.size();
  return sum;
}

void PlaceIndex::refuse(const std::string& robot, const std::string& why) {
  const Refusal refusal{robot, why};
  if (std::find(refused_.begin(), refused_.end(), refusal) != refused_.end()) return;
  refused_.push_back(refusal);
  refusals_.push_back(refusal);
}

std::vector<PlaceIndex::Refusal> PlaceIndex::takeRefusals() {
  return std::exchange(refusals_, {});
}

}  // namespace omnifleet::estimation
