#include "global_merger/places.h"

#include <algorithm>

#include "common/messages.h"

namespace omnifleet::services {

Places::Places(const bus::ServiceContext& context, const fleet::Fleet& fleet, bool reads, RunEnds& ends) {
  if (!reads) return;
  reader_ = context.bus.reader(context.topics.place);
  for (const std::string& robot : fleet.locatedRobots()) {
    Stream& stream = streams_[robot];
    ends.listen("place " + robot, [&stream](TimeNs, std::uint64_t samples) { stream.announced = samples; });
  }
}

bool Places::pull(bus::StatusBoard& status) {
  if (!reader_) return false;
  bool any = false;
  while (reader_->take(sample_)) {
    any = true;
    const bool is_good = adapters::fromWire(sample_, place_);
    const auto stream = streams_.find(place_.robot);
    if (stream != streams_.end()) ++stream->second.arrived;
    if (is_good && stream != streams_.end()) {
      files_.add(place_);
    } else {
      status.dropped();
      status.report(sampleRejected("place " + place_.robot));
    }
  }
  return any;
}

bool Places::complete() const {
  return std::all_of(streams_.begin(), streams_.end(),
                     [](const auto& entry) { return entry.second.arrived >= entry.second.announced; });
}

}  // namespace omnifleet::services
