#pragma once

// The one owner of determinism (CONTRIBUTING, "Determinism"): ordering, watermarks, previous-frame feedback,
// the one-loan rule and the end of streams. No DDS here.

#include <chrono>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "observation/observation.h"

namespace omnifleet::bus {

enum class StreamRole {
  kInput,     ///< its samples make batches
  kFeedback,  ///< a later stage's result: used one primary frame late, so that no stage waits for its own
              ///< output
  kSide,      ///< held until the next row (wheel speeds): rows before t go out with the batch at t, make none
};

enum class StreamMode {
  kLockstep,  ///< nothing passes it
  kLive,      ///< holds nobody up
};

struct StreamSpec {
  std::string name;   ///< for messages, e.g. "local_map of r1"
  std::string robot;  ///< second in the order
  int rank = 0;       ///< of the topic: third in the order
  StreamRole role = StreamRole::kInput;
  StreamMode mode = StreamMode::kLockstep;
  bool primary = true;  ///< inputs only: its times are the "previous frame" of the feedback rule
};

/// The stream that holds everything up.
struct Waiting {
  int stream = -1;
  std::string name;
  std::chrono::nanoseconds silent{0};  ///< since it was first seen to hold things up, or last moved
};

/// The times only; TimeMerger<Payload> carries the samples beside it.
class TimeOrder {
 public:
  using Monotonic = std::chrono::steady_clock::time_point;
  struct Step {  ///< take the head of `stream`
    int stream;
    TimeNs time;
  };

  int add(StreamSpec spec);
  bool push(int stream, TimeNs time);
  void advance(int stream, TimeNs watermark);
  void promise(int stream, TimeNs last, TimeNs until);
  void end(int stream, std::uint64_t sample_count);
  bool wants(int stream) const;
  /// The next batch's time; feedback, side rows and inputs in the order in which they are to be taken.
  bool next(TimeNs& time, std::vector<Step>& feedback, std::vector<Step>& side, std::vector<Step>& inputs);
  std::optional<Waiting> waitingFor(Monotonic now);
  bool finished() const;
  std::uint64_t rejected(int stream) const { return streams_.at(stream).rejected; }
  const StreamSpec& spec(int stream) const { return streams_.at(stream).spec; }

 private:
  struct Stream {
    StreamSpec spec;
    std::deque<TimeNs> queue;
    TimeNs complete_until;                 ///< everything up to and including this time has arrived
    TimeNs promised_last, promised_until;  ///< the newest promise whose last sample has not arrived
    std::uint64_t arrived = 0, rejected = 0;
    std::optional<std::uint64_t> announced;  ///< sample count of run/end
    bool live() const { return spec.mode == StreamMode::kLive; }
    bool ended() const { return announced && (live() || arrived >= *announced); }
    bool reached(TimeNs t) const { return live() || ended() || complete_until >= t; }
  };
  std::optional<TimeNs> candidate() const;
  bool holdsUp(const Stream& stream, std::optional<TimeNs> time) const;
  std::optional<int> blocker() const;
  /// Appends the heads of `role` up to and including `until` (feedback that is live: all), popped, in order.
  void take(StreamRole role, std::optional<TimeNs> until, std::vector<Step>& out);

  std::vector<Stream> streams_;
  std::optional<TimeNs> previous_;  ///< time of the last batch with a primary sample
  int blocked_by_ = -1;
  std::uint64_t blocked_arrived_ = 0;
  TimeNs blocked_until_ = 0;
  Monotonic blocked_since_{};
};

/// Merges the streams of one stage. Payload is what the stage wants to get back, e.g. a std::variant of its
/// input types or a FrameView. Not thread-safe; one call per arriving sample, no clock of its own.
///
///   while (reader->take(sample)) merger.push(local_map, time, sample);
///   while (merger.nextBatch(batch)) process(batch);
///
/// A batch at time t is released once every lockstep input and side stream has reached t (its head, an
/// earlier sample or a watermark says that nothing up to t is missing) or has ended, and every feedback
/// stream has delivered all up to the previous primary time. Same samples, same batches: however the arrivals
/// interleave.
template <class Payload>
class TimeMerger {
 public:
  struct Item {
    int stream = -1;
    TimeNs time = 0;
    Payload payload{};
  };
  struct Batch {
    TimeNs time = 0;
    std::vector<Item>
        feedback;            ///< times ≤ the previous primary time, in (time, robot, rank) order; use first
    std::vector<Item> side;  ///< times < time, likewise
    std::vector<Item> inputs;  ///< at `time`, in (robot, rank) order; never empty
  };

  /// Returns the stream's number. Streams are declared before the first push.
  int addStream(StreamSpec spec) {
    queues_.emplace_back();
    return order_.add(std::move(spec));
  }
  /// False: not later than the stream's last sample or watermark; dropped and counted (it still counts as
  /// arrived).
  bool push(int stream, TimeNs time, Payload payload) {
    if (!order_.push(stream, time)) return false;
    queues_[stream].push_back(std::move(payload));
    return true;
  }
  /// Watermark: all samples of the stream up to and including this time have been pushed, or will never come.
  void advance(int stream, TimeNs watermark) { order_.advance(stream, watermark); }
  /// A watermark that may overtake the samples: after the one at `last`, which may still be on its way, none
  /// up to and including `until` will come. The newest promise counts; live streams take none.
  void promise(int stream, TimeNs last, TimeNs until) { order_.promise(stream, last, until); }
  /// From run/end, which may overtake the samples: the stream ends once so many have arrived.
  void end(int stream, std::uint64_t sample_count) { order_.end(stream, sample_count); }
  /// One-loan rule of frame streams: pull one frame only when this says so.
  bool wants(int stream) const { return order_.wants(stream); }

  /// The next batch into the caller's object, whose vectors are reused. False: something is missing.
  bool nextBatch(Batch& batch) {
    if (!order_.next(batch.time, feedback_, side_, inputs_)) return false;
    fill(feedback_, batch.feedback);
    fill(side_, batch.side);
    fill(inputs_, batch.inputs);
    return true;
  }

  /// Who holds things up and for how long by the caller's monotonic clock; nobody when finished or only live
  /// streams are waited for. To be called regularly: durations run between calls.
  std::optional<Waiting> waitingFor(TimeOrder::Monotonic now) { return order_.waitingFor(now); }
  /// Every lockstep input has ended and everything was handed out (feedback and side rows of no use may
  /// remain).
  bool finished() const { return order_.finished(); }
  std::uint64_t rejected(int stream) const { return order_.rejected(stream); }
  const StreamSpec& spec(int stream) const { return order_.spec(stream); }

 private:
  void fill(const std::vector<TimeOrder::Step>& steps, std::vector<Item>& items) {
    items.resize(steps.size());
    for (std::size_t i = 0; i < steps.size(); ++i) {
      auto& queue = queues_[steps[i].stream];
      items[i].stream = steps[i].stream;
      items[i].time = steps[i].time;
      items[i].payload = std::move(queue.front());
      queue.pop_front();
    }
  }

  TimeOrder order_;
  std::vector<std::deque<Payload>> queues_;
  std::vector<TimeOrder::Step> feedback_, side_, inputs_;
};

}  // namespace omnifleet::bus
