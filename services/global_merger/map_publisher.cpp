#include "global_merger/map_publisher.h"

#include "adapters/common.h"
#include "common/messages.h"

namespace omnifleet::services {
namespace {

constexpr TimeNs kPeriodNs = 1'000'000'000;

template <class T>
void put(bus::Writer<T>& writer, const T& sample, bus::StatusBoard& status) {
  if (!writer.write(sample)) status.report(services::writeFailed("map", writer.error()));
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
  tiles_.clear();
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

  for (v1::Outlines& tile : tiles_.update(merger.lastOutlines(), merger.rejected())) {
    tile.map_name(map_name_);
    adapters::fillHeader(now, sequence_, clock_, tile.header());
    tile.term(term_);
    put(*outlines_, tile, status);
  }
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
