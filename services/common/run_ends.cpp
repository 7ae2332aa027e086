#include "common/run_ends.h"

namespace omnifleet::services {

RunEnds::RunEnds(const bus::ServiceContext& context, adapters::RunClock clock)
    : bus_(context.bus),
      is_live_(!bus::isDeterministic(context.options.mode)),
      clock_(clock),
      reader_(context.bus.reader(context.topics.run_end)),
      writer_(context.bus.writer(context.topics.run_end)) {}

void RunEnds::listen(const std::string& stream, Ended ended) {
  listeners_[stream] = std::move(ended);
}

bool RunEnds::poll() {
  bool received = false;
  while (reader_->take(sample_)) {
    const auto listener = listeners_.find(sample_.stream().to_string());
    if (listener == listeners_.end()) continue;
    const TimeNs last = sample_.samples() == 0 ? kNothing : sample_.header().acquired_ns();
    const Ended ended = std::move(listener->second);
    listeners_.erase(listener);
    ended(last, sample_.samples());
    received = true;
  }
  return received;
}

void RunEnds::announce(const std::string& stream, TimeNs last, std::uint64_t samples,
                       const std::string& reason) {
  if (is_live_ && bus_.stopping()) return;
  v1::RunEnd end;
  end.stream(stream);
  adapters::fillHeader(last, 0, clock_, end.header());
  end.samples(samples);
  end.reason(reason.substr(0, 255));
  // The write of a keep-last topic fails only if a reader is gone, which then needs no announcement.
  if (!writer_->write(end)) return;
}

}  // namespace omnifleet::services
