#include "global_merger/map_publisher.h"

#include <algorithm>

#include "common/messages.h"
#include "global_merger/verdict.h"

#include "adapters/common.h"

namespace omnifleet::services {
namespace {

constexpr TimeNs kPeriodNs = 1'000'000'000;
constexpr std::size_t kMaxOutlines = 256, kMaxVertices = 128, kMaxObservers = 32, kMaxRejected = 64;

template <class T>
void put(bus::Writer<T>& writer, const T& sample, bus::StatusBoard& status) {
  if (!writer.write(sample)) status.report(services::writeFailed("map", writer.error()));
}

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

}  // namespace

MapPublisher::MapPublisher(const bus::ServiceContext& context, const std::string& map_name,
                           const std::string& replica, adapters::RunClock clock)
    : map_name_(map_name),
      replica_(replica),
      bus_(context.bus),
      topics_(context.topics),
      clock_(clock),
      hash_(context.bus.writer(context.topics.map_hash)) {}

void MapPublisher::speak(std::uint32_t term) {
  term_ = term;
  last_ns_ = INT64_MIN;
  last_hash_ = {};
  // A late joiner must not get the last map of a replica that speaks no more.
  octree_ = term > 0 ? bus_.writer(topics_.map_octree) : nullptr;
  grid_ = term > 0 ? bus_.writer(topics_.map_grid) : nullptr;
  outlines_ = term > 0 ? bus_.writer(topics_.map_outlines) : nullptr;
}

void MapPublisher::update(global_merger::Merger& merger, TimeNs now, bool force, bus::StatusBoard& status,
                          const global_merger::Meanwhile& meanwhile) {
  if (!force && last_ns_ != INT64_MIN && now - last_ns_ < kPeriodNs) return;
  last_ns_ = now;
  if (!force && merger.map().hash() == last_hash_) return;
  if (term_ > 0) merger.outlines(meanwhile);
  last_hash_ = merger.map().hash();
  ++sequence_;
  if (term_ > 0) publishMap(merger, now, status);
  publishHash(merger, now, status);
}

void MapPublisher::publishMap(const global_merger::Merger& merger, TimeNs now, bus::StatusBoard& status) {
  const dataset::OccupancyGrid cells = merger.grid(merger.lastOutlines());
  const std::string bt = merger.map().octreeBytes(merger.lastOutlines());

  v1::OctreeMap octree;
  octree.map_name(map_name_);
  adapters::fillHeader(now, sequence_, clock_, octree.header());
  octree.term(term_);
  octree.resolution_m(cells.resolution_m);
  octree.bt().assign(bt.begin(), bt.end());
  put(*octree_, octree, status);

  v1::Grid grid;
  grid.map_name(map_name_);
  adapters::fillHeader(now, sequence_, clock_, grid.header());
  grid.term(term_);
  grid.resolution_m(cells.resolution_m);
  grid.origin(adapters::point(cells.origin_m));
  grid.width(static_cast<std::uint32_t>(cells.width));
  grid.height(static_cast<std::uint32_t>(cells.height));
  grid.cells().assign(cells.cells.begin(), cells.cells.end());  // -1 becomes 255
  put(*grid_, grid, status);

  v1::Outlines outlines;
  outlines.map_name(map_name_);
  adapters::fillHeader(now, sequence_, clock_, outlines.header());
  outlines.term(term_);
  adapters::sequenceToWire(merger.lastOutlines(), kMaxOutlines, outlines.objects(), outlineToWire);
  adapters::sequenceToWire(merger.rejected(), kMaxRejected, outlines.rejected(),
                           [](const global_merger::RejectedCandidate& from, v1::RejectedCandidate& to) {
                             to.position(adapters::point(from.at_m));
                             to.reason(reasonToWire(from.reason));
                             to.observations(static_cast<std::uint32_t>(from.observations));
                           });
  put(*outlines_, outlines, status);
}

void MapPublisher::publishHash(global_merger::Merger& merger, TimeNs now, bus::StatusBoard& status) {
  v1::MapHash hash;
  hash.replica(replica_);
  adapters::fillHeader(now, sequence_, clock_, hash.header());
  hash.sha256(last_hash_);
  hash.contributions(static_cast<std::uint32_t>(merger.map().store().contributions()));
  hash.keyframe_poses(static_cast<std::uint32_t>(merger.map().store().poses()));
  put(*hash_, hash, status);
}

}  // namespace omnifleet::services
