#include <unistd.h>

#include "bus/robot_claim.h"
#include "bus/service_runner.h"

namespace omnifleet::bus {

StatusPublisher::StatusPublisher(Bus& bus, const Topics& topics, std::string service, std::string instance)
    : bus_(bus), writer_(bus.writer(topics.service_status)), instance_(std::move(instance)) {
  sample_.service(std::move(service));
  sample_.instance(instance_);
  sample_.process_id(static_cast<std::uint32_t>(::getpid()));
}

/// A key that the process does not use any more must not count as silent.
void StatusPublisher::setInstance() {
  constexpr std::size_t kInstanceLimit = 64;  // bound of instance in service.idl
  std::string instance = instance_;
  if (!bus_.rival().empty()) {
    const RobotClaim self = RobotClaim::ofThisProcess({}, {});
    instance += "@" + self.host.substr(0, kInstanceLimit / 4) + ":" + std::to_string(self.pid);
  }
  instance = instance.substr(0, kInstanceLimit);
  if (sample_.instance().to_string() == instance) return;
  if (sample_.instance().to_string() != instance_) {
    sample_.state(static_cast<v1::ServiceState>(ServiceState::kFinished));
    write();
  }
  sample_.instance(instance);
}

void StatusPublisher::setTraffic(std::chrono::steady_clock::time_point now) {
  const Traffic total = bus_.traffic();
  constexpr std::chrono::milliseconds kShortest{
      900};  // of the interval of a rate; a change is published sooner
  const bool is_known = traffic_at_ != std::chrono::steady_clock::time_point{};
  if (is_known && now - traffic_at_ < kShortest) return;
  const double seconds = std::chrono::duration<double>(now - traffic_at_).count();
  const auto rate = [&](std::uint64_t to, std::uint64_t from) {
    return is_known ? static_cast<double>(to - from) / seconds : 0.0;
  };
  sample_.bytes_out_per_s(rate(total.out_bytes, traffic_.out_bytes));
  sample_.bytes_in_per_s(rate(total.in_bytes, traffic_.in_bytes));
  traffic_ = total;
  traffic_at_ = now;
}

void StatusPublisher::write() {
  // A failed write is ignored: the next status follows within a second.
  [[maybe_unused]] const bool written = writer_->write(sample_);
}

void StatusPublisher::update(StatusBoard& board, std::chrono::steady_clock::time_point now, bool force) {
  constexpr std::chrono::seconds kPeriod{1};
  constexpr std::size_t kErrorLimit = 512;  // bound of last_error in service.idl
  if (!force && !board.changed() && now - last_ < kPeriod) return;
  setInstance();
  setTraffic(now);
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
  write();
}

}  // namespace omnifleet::bus
