#include "global_merger/alignments.h"

#include <algorithm>
#include <utility>

#include "common/messages.h"

namespace omnifleet::services {

Alignments::Alignments(const bus::ServiceContext& context, const fleet::Fleet& fleet, bool reads,
                       RunEnds& ends) {
  if (!reads) return;
  reader_ = context.bus.reader(context.topics.alignment);
  for (const std::string& robot : fleet.locatedRobots()) {
    Stream& stream = streams_[robot];
    ends.listen("alignment " + robot, [&stream](TimeNs last, std::uint64_t) { stream.last_ns = last; });
  }
}

bool Alignments::pull(bus::StatusBoard& status) {
  if (!reader_) return false;
  bool any = false;
  while (reader_->take(sample_)) {
    any = true;
    Alignment alignment;
    const bool is_good = adapters::fromWire(sample_, alignment);
    if (const auto stream = streams_.find(alignment.robot); stream != streams_.end())
      stream->second.arrived_ns = std::max(stream->second.arrived_ns, alignment.acquired_ns);
    if (is_good) {
      latest_[alignment.robot] = std::move(alignment);
    } else {
      status.dropped();
      status.report(sampleRejected("alignment " + alignment.robot));
    }
  }
  return any;
}

bool Alignments::complete() const {
  return std::all_of(streams_.begin(), streams_.end(),
                     [](const auto& entry) { return entry.second.arrived_ns >= entry.second.last_ns; });
}

}  // namespace omnifleet::services
