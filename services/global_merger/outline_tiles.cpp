#include "global_merger/outline_tiles.h"

#include <algorithm>
#include <cmath>

#include "adapters/common.h"
#include "global_merger/structure_objects.h"
#include "global_merger/verdict.h"

namespace omnifleet::services {
namespace {

// Bounds of map.idl.
constexpr std::size_t kMaxOutlines = 256, kMaxVertices = 128, kMaxObservers = 32, kMaxRejected = 64;

void outlineToWire(const dataset::MapObject& from, v1::Outline& to) {
  to.id(static_cast<std::uint32_t>(from.id));
  to.kind(from.kind == "robot" ? v1::OUTLINE_ROBOT
          : from.isOpen()      ? v1::OUTLINE_STRUCTURE
                               : v1::OUTLINE_OBSTACLE);
  std::uint8_t quality = 0;
  for (const auto flag : {global_merger::Quality::kLowContrast, global_merger::Quality::kDisagreeing,
                          global_merger::Quality::kThin})
    if (std::count(from.quality.begin(), from.quality.end(), global_merger::toString(flag)) > 0)
      quality |= static_cast<std::uint8_t>(flag);
  to.quality(quality);
  to.centroid(adapters::point(from.centroid_m));
  to.footprint().clear();
  for (std::size_t i = 0; i < std::min(from.outline_m.size(), kMaxVertices); ++i) {
    to.footprint().push_back(static_cast<float>(from.outline_m[i].x()));
    to.footprint().push_back(static_cast<float>(from.outline_m[i].y()));
  }
  to.height_m(static_cast<float>(from.height_m));
  const Eigen::Matrix2f covariance = from.covariance_m2.cast<float>();
  to.covariance({covariance(0, 0), covariance(0, 1), covariance(1, 1)});
  to.observations(static_cast<std::uint32_t>(from.observations));
  adapters::sequenceToWire(from.observers, kMaxObservers, to.observers(),
                           [](const std::string& name, auto& w) { w = name; });
}

v1::RejectionReason reasonToWire(global_merger::Reason reason) {
  using global_merger::Reason;
  switch (reason) {
    case Reason::kUncertainPlace:
      return v1::REJECTED_UNCERTAIN_PLACE;
    case Reason::kPiece:
      return v1::REJECTED_PIECE;
    case Reason::kRough:
      return v1::REJECTED_ROUGH;
    case Reason::kFlat:
      return v1::REJECTED_FLAT;
    case Reason::kPattern:
      return v1::REJECTED_PATTERN;
    case Reason::kFloorSeen:
      return v1::REJECTED_FLOOR_SEEN;
    case Reason::kPossibleMirror:
      return v1::REJECTED_POSSIBLE_MIRROR;
    case Reason::kHidden:
      return v1::REJECTED_HIDDEN;
    case Reason::kTopFaceOnly:
      return v1::REJECTED_TOP_FACE_ONLY;
    default:
      return v1::REJECTED_NO_SHAPE;
  }
}

void rejectedToWire(const global_merger::RejectedCandidate& from, v1::RejectedCandidate& to) {
  to.position(adapters::point(from.at_m));
  to.reason(reasonToWire(from.reason));
  to.observations(static_cast<std::uint32_t>(from.observations));
}

std::int32_t tileOf(double coordinate_m) {
  return static_cast<std::int32_t>(std::floor(coordinate_m / OutlineTiles::kSide_m));
}

v1::Outlines emptyTile(std::pair<std::int32_t, std::int32_t> index) {
  v1::Outlines tile;
  tile.tile_x(index.first);
  tile.tile_y(index.second);
  tile.tile_m(static_cast<float>(OutlineTiles::kSide_m));
  return tile;
}

}  // namespace

std::vector<v1::Outlines> OutlineTiles::update(
    const std::vector<dataset::MapObject>& objects,
    const std::vector<global_merger::RejectedCandidate>& rejected) {
  std::map<Index, v1::Outlines> tiles;
  const auto tileAt = [&](const Eigen::Vector2d& at_m) -> v1::Outlines& {
    const Index index{tileOf(at_m.x()), tileOf(at_m.y())};
    return tiles.try_emplace(index, emptyTile(index)).first->second;
  };
  for (const dataset::MapObject& object : objects) {
    auto& into = tileAt(object.centroid_m).objects();
    if (into.size() >= kMaxOutlines) continue;
    outlineToWire(object, into.emplace_back());
    // Counted over the whole map, a new piece of wall would change all others.
    if (object.id >= global_merger::kFirstStructureId)
      into.back().id(static_cast<std::uint32_t>(global_merger::kFirstStructureId + into.size() - 1));
  }
  for (const global_merger::RejectedCandidate& candidate : rejected) {
    auto& into = tileAt(candidate.at_m).rejected();
    if (into.size() < kMaxRejected) rejectedToWire(candidate, into.emplace_back());
  }
  for (const auto& [index, tile] : published_) {
    if (tiles.count(index) == 0) tiles.emplace(index, emptyTile(index));
  }
  std::vector<v1::Outlines> changed;
  for (auto& [index, tile] : tiles) {
    v1::Outlines& before = published_[index];
    if (before == tile) continue;
    changed.push_back(tile);
    before = std::move(tile);
  }
  return changed;
}

}  // namespace omnifleet::services
