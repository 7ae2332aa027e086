#include "bus/status_board.h"

#include <algorithm>
#include <utility>

namespace omnifleet::bus {
namespace {

constexpr std::size_t kWindow = 1024;  ///< number of latencies kept
constexpr std::size_t kMessagesKept = 64;

double quantile(std::vector<float>& values, double q) {
  if (values.empty()) return 0.0;
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

}  // namespace

const char* toString(ServiceState state) {
  switch (state) {
    case ServiceState::kStarting:
      return "starting";
    case ServiceState::kWaiting:
      return "waiting";
    case ServiceState::kRunning:
      return "running";
    case ServiceState::kDegraded:
      return "degraded";
    case ServiceState::kStopping:
      return "stopping";
    case ServiceState::kFinished:
      return "finished";
  }
  return "?";
}

void StatusBoard::state(ServiceState state) {
  changed_ = changed_ || state != state_;
  state_ = state;
}

void StatusBoard::processed(std::chrono::nanoseconds latency, bool valid) {
  ++processed_;
  if (!valid) ++invalid_;
  const float ms = std::chrono::duration<float, std::milli>(latency).count();
  if (latency_ms_.size() < kWindow) {
    latency_ms_.push_back(ms);
  } else {
    latency_ms_[next_] = ms;
    next_ = (next_ + 1) % kWindow;
  }
}

void StatusBoard::dropped(std::uint64_t count) {
  drops_ += count;
}

void StatusBoard::update(Message message, bool degrades) {
  changed_ = changed_ || message != last_error_ || degrades != degraded_;
  last_error_ = std::move(message);
  degraded_ = degrades;
}

void StatusBoard::report(Message message, bool degrades) {
  update(std::move(message), degrades);
  if (last_error_ == last_message_) return;
  last_message_ = last_error_;
  if (messages_.size() < kMessagesKept) {
    messages_.push_back(last_error_);
  } else {
    ++messages_left_out_;
  }
}

std::vector<Message> StatusBoard::takeMessages() {
  std::vector<Message> taken;
  taken.swap(messages_);
  if (messages_left_out_ > 0)
    taken.push_back({ErrorCode::kNone, std::to_string(messages_left_out_) + " more messages were left out"});
  messages_left_out_ = 0;
  return taken;
}

void StatusBoard::clearError() {
  changed_ = changed_ || degraded_ || last_error_ != Message{};
  degraded_ = false;
  last_error_ = {};
}

StatusBoard::Snapshot StatusBoard::snapshot(Clock::time_point now) {
  Snapshot result;
  result.state = degraded_ && state_ == ServiceState::kRunning ? ServiceState::kDegraded : state_;
  const double seconds = std::chrono::duration<double>(now - since_).count();
  if (since_ != Clock::time_point{} && seconds > 0) {
    result.rate_hz = static_cast<double>(processed_ - processed_before_) / seconds;
  }
  std::vector<float> sorted = latency_ms_;
  result.latency_p50_ms = quantile(sorted, 0.5);
  result.latency_p99_ms = quantile(sorted, 0.99);
  result.processed = processed_;
  result.invalid = invalid_;
  result.drops = drops_;
  result.expected = expected_;
  result.last_error = last_error_;
  since_ = now;
  processed_before_ = processed_;
  changed_ = false;
  return result;
}

}  // namespace omnifleet::bus
