#include <unistd.h>

#include "bus/service_runner.h"

namespace omnifleet::bus {

StatusPublisher::StatusPublisher(Bus& bus, const Topics& topics, std::string service, std::string instance)
    : writer_(bus.writer(topics.service_status)) {
  sample_.service(std::move(service));
  sample_.instance(std::move(instance));
  sample_.process_id(static_cast<std::uint32_t>(::getpid()));
}

void StatusPublisher::update(StatusBoard& board, std::chrono::steady_clock::time_point now, bool force) {
  constexpr std::chrono::seconds kPeriod{1};
  constexpr std::size_t kErrorLimit = 512;  // bound of last_error in service.idl
  if (!force && !board.changed() && now - last_ < kPeriod) return;
  last_ = now;
  const StatusBoard::Snapshot figures = board.snapshot(now);
  sample_.published_ns(std::chrono::duration_cast<std::chrono::nanoseconds>(
                           std::chrono::system_clock::now().time_since_epoch())
                           .count());
  sample_.state(static_cast<v1::ServiceState>(figures.state));
  sample_.processed(figures.processed);
  sample_.invalid(figures.invalid);
  sample_.dropped(figures.drops);
  sample_.expected(figures.expected);
  sample_.rate_hz(figures.rate_hz);
  sample_.latency_p50_ms(figures.latency_p50_ms);
  sample_.latency_p99_ms(figures.latency_p99_ms);
  sample_.error_code(toString(figures.last_error.code));
  sample_.last_error(figures.last_error.text.substr(0, kErrorLimit));
  // A failed write is ignored: the next status follows within a second.
  [[maybe_unused]] const bool written = writer_->write(sample_);
}

}  // namespace omnifleet::bus
