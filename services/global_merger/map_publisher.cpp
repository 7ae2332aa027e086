#include "global_merger/map_publisher.h"

#include "common/messages.h"

#include "adapters/common.h"

namespace omnifleet::services {
namespace {

constexpr TimeNs kPeriodNs = 1'000'000'000;
constexpr std::uint32_t kTerm = 1;
constexpr std::size_t kMaxOutlines = 256, kMaxVertices = 128, kMaxObservers = 32;

template <class T>
void put(bus::Writer<T>& writer, const T& sample, bus::StatusBoard& status) {
  if (!writer.write(sample)) status.report(services::writeFailed("map", writer.error()));
}

void outlineToWire(const dataset::MapObject& from, v1::Outline& to) {
  to.id(static_cast<std::uint32_t>(from.id));
  to.kind(static_cast<std::uint8_t>(from.kind == "robot" ? ObjectKind::kRobot : ObjectKind::kObstacle));
  to.centroid(adapters::point(from.centroid_m));
  adapters::sequenceToWire(from.outline_m, kMaxVertices, to.footprint(),
                           [](const Eigen::Vector2d& p, v1::Point2& w) { w = adapters::point(p); });
  to.height_m(from.height_m);
  to.observations(static_cast<std::uint32_t>(from.observations));
  adapters::sequenceToWire(from.observers, kMaxObservers, to.observers(),
                           [](const std::string& name, auto& w) { w = name; });
}

}  // namespace

MapPublisher::MapPublisher(const bus::ServiceContext& context, const std::string& map_name,
                           const std::string& replica, bool publishes)
    : map_name_(map_name),
      replica_(replica),
      publishes_(publishes),
      clock_(context.options.mode == bus::RunMode::kLive     ? adapters::RunClock::kSystem
             : context.options.mode == bus::RunMode::kReplay ? adapters::RunClock::kDataset
                                                             : adapters::RunClock::kSim),
      hash_(context.bus.writer(context.topics.map_hash)) {
  if (!publishes) return;
  octree_ = context.bus.writer(context.topics.map_octree);
  grid_ = context.bus.writer(context.topics.map_grid);
  outlines_ = context.bus.writer(context.topics.map_outlines);
}

void MapPublisher::update(global_merger::Merger& merger, TimeNs now, bool force, bus::StatusBoard& status,
                          const global_merger::Meanwhile& meanwhile) {
  if (!force && last_ns_ != INT64_MIN && now - last_ns_ < kPeriodNs) return;
  last_ns_ = now;
  if (!force && merger.map().hash() == last_hash_) return;
  if (publishes_) merger.outlines(meanwhile);
  last_hash_ = merger.map().hash();
  ++sequence_;
  if (publishes_) publishMap(merger, now, status);
  publishHash(merger, now, status);
}

void MapPublisher::publishMap(const global_merger::Merger& merger, TimeNs now, bus::StatusBoard& status) {
  const dataset::OccupancyGrid cells = merger.map().grid(merger.lastOutlines());
  const std::string bt = merger.map().octreeBytes(merger.lastOutlines());

  v1::OctreeMap octree;
  octree.map_name(map_name_);
  adapters::fillHeader(now, sequence_, clock_, octree.header());
  octree.term(kTerm);
  octree.resolution_m(cells.resolution_m);
  octree.bt().assign(bt.begin(), bt.end());
  put(*octree_, octree, status);

  v1::Grid grid;
  grid.map_name(map_name_);
  adapters::fillHeader(now, sequence_, clock_, grid.header());
  grid.term(kTerm);
  grid.resolution_m(cells.resolution_m);
  grid.origin(adapters::point(cells.origin_m));
  grid.width(static_cast<std::uint32_t>(cells.width));
  grid.height(static_cast<std::uint32_t>(cells.height));
  grid.cells().assign(cells.cells.begin(), cells.cells.end());  // -1 becomes 255
  put(*grid_, grid, status);

  v1::Outlines outlines;
  outlines.map_name(map_name_);
  adapters::fillHeader(now, sequence_, clock_, outlines.header());
  outlines.term(kTerm);
  adapters::sequenceToWire(merger.lastOutlines(), kMaxOutlines, outlines.objects(), outlineToWire);
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
