#include "bus/time_merger.h"

#include <algorithm>
#include <limits>
#include <tuple>

namespace omnifleet::bus {

int TimeOrder::add(StreamSpec spec) {
  Stream stream;
  stream.spec = std::move(spec);
  stream.complete_until = std::numeric_limits<TimeNs>::min();
  stream.promised_last = stream.promised_until = stream.complete_until;
  streams_.push_back(std::move(stream));
  return static_cast<int>(streams_.size()) - 1;
}

bool TimeOrder::push(int index, TimeNs time) {
  Stream& stream = streams_.at(index);
  ++stream.arrived;
  if (time <= stream.complete_until) {
    ++stream.rejected;
    return false;
  }
  stream.complete_until = time >= stream.promised_last ? std::max(time, stream.promised_until) : time;
  stream.queue.push_back(time);
  return true;
}

void TimeOrder::advance(int index, TimeNs watermark) {
  Stream& stream = streams_.at(index);
  stream.complete_until = std::max(stream.complete_until, watermark);
}

void TimeOrder::promise(int index, TimeNs last, TimeNs until) {
  Stream& stream = streams_.at(index);
  if (stream.live() || until <= stream.promised_until) return;
  stream.promised_last = last;
  stream.promised_until = until;
  if (stream.complete_until >= last) advance(index, until);
}

void TimeOrder::end(int index, std::uint64_t sample_count) {
  streams_.at(index).announced = sample_count;
}

bool TimeOrder::wants(int index) const {
  const Stream& stream = streams_.at(index);
  return stream.queue.empty() && !stream.ended();
}

std::optional<TimeNs> TimeOrder::candidate() const {
  std::optional<TimeNs> first;
  for (const Stream& stream : streams_) {
    if (stream.spec.role != StreamRole::kInput || stream.queue.empty()) continue;
    if (!first || stream.queue.front() < *first) first = stream.queue.front();
  }
  return first;
}

/// Whether a batch at `time` (or, without a time, the first batch) must wait for this stream.
bool TimeOrder::holdsUp(const Stream& stream, std::optional<TimeNs> time) const {
  if (stream.spec.role == StreamRole::kFeedback) return time && previous_ && !stream.reached(*previous_);
  if (time) return !stream.reached(*time);
  return stream.spec.role == StreamRole::kInput && !stream.live() && !stream.ended();
}

/// The stream that is furthest behind among those that block the next batch.
std::optional<int> TimeOrder::blocker() const {
  const std::optional<TimeNs> time = candidate();
  std::optional<int> slowest;
  for (int i = 0; i < static_cast<int>(streams_.size()); ++i) {
    if (!holdsUp(streams_[i], time)) continue;
    if (!slowest || streams_[i].complete_until < streams_[*slowest].complete_until) slowest = i;
  }
  return slowest;
}

void TimeOrder::take(StreamRole role, std::optional<TimeNs> until, std::vector<Step>& out) {
  out.clear();
  for (int i = 0; i < static_cast<int>(streams_.size()); ++i) {
    Stream& stream = streams_[i];
    if (stream.spec.role != role) continue;
    const bool all = role == StreamRole::kFeedback && stream.live();
    while (!stream.queue.empty() && (all || (until && stream.queue.front() <= *until))) {
      out.push_back({i, stream.queue.front()});
      stream.queue.pop_front();
    }
  }
  const auto order = [this](const Step& step) {
    const StreamSpec& spec = streams_[step.stream].spec;
    return std::tie(step.time, spec.robot, spec.rank, step.stream);
  };
  std::sort(out.begin(), out.end(), [&](const Step& a, const Step& b) { return order(a) < order(b); });
}

bool TimeOrder::next(TimeNs& time, std::vector<Step>& feedback, std::vector<Step>& side,
                     std::vector<Step>& inputs) {
  const std::optional<TimeNs> next_time = candidate();
  if (!next_time || blocker()) return false;
  time = *next_time;
  take(StreamRole::kFeedback, previous_, feedback);
  take(StreamRole::kSide, time - 1, side);
  take(StreamRole::kInput, time, inputs);
  for (const Step& step : inputs) {
    if (streams_[step.stream].spec.primary) previous_ = time;
  }
  return true;
}

std::optional<Waiting> TimeOrder::waitingFor(Monotonic now) {
  const std::optional<int> index = finished() ? std::nullopt : blocker();
  if (!index) {
    blocked_by_ = -1;
    return std::nullopt;
  }
  const Stream& stream = streams_[*index];
  const bool moved = stream.arrived != blocked_arrived_ || stream.complete_until != blocked_until_;
  if (blocked_by_ != *index || moved) blocked_since_ = now;
  blocked_by_ = *index;
  blocked_arrived_ = stream.arrived;
  blocked_until_ = stream.complete_until;
  return Waiting{*index, stream.spec.name, now - blocked_since_};
}

bool TimeOrder::finished() const {
  bool lockstep = false, lockstep_ended = true, all_ended = true, any = false;
  for (const Stream& stream : streams_) {
    if (stream.spec.role != StreamRole::kInput) continue;
    if (!stream.queue.empty()) return false;
    any = true;
    all_ended = all_ended && stream.ended();
    if (stream.live()) continue;
    lockstep = true;
    lockstep_ended = lockstep_ended && stream.ended();
  }
  return any && (lockstep ? lockstep_ended : all_ended);
}

}  // namespace omnifleet::bus
