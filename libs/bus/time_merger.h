#pragma once

// Implements determinism (CONTRIBUTING, "Determinism"): order, watermarks, previous-frame feedback, the
// one-loan rule and the end of streams. Independent of DDS.

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
  kInput,     ///< its samples form batches
  kFeedback,  ///< result of a later stage, used one primary frame late so that no stage waits for its own
              ///< output
  kSide,      ///< held until the next row (wheel speeds): rows before t join the batch at t and form none
};

enum class StreamMode {
  kLockstep,  ///< a batch waits for this stream
  kLive,      ///< no batch waits for this stream
};

struct StreamSpec {
  std::string name;   ///< for messages, e.g. "local_map of r1"
  std::string robot;  ///< second sort key
  int rank = 0;       ///< of the topic: third sort key
  StreamRole role = StreamRole::kInput;
  StreamMode mode = StreamMode::kLockstep;
  bool primary = true;  ///< inputs only: its times define the "previous frame" of the feedback rule
};

/// The stream that blocks the next batch.
struct Waiting {
  int stream = -1;
  std::string name;
  std::chrono::nanoseconds silent{0};  ///< since it first blocked or last made progress
};

/// The order of times only; TimeMerger<Payload> holds the samples.
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
  /// The time of the next batch, and its feedback, side rows and inputs in the order in which they are taken.
  bool next(TimeNs& time, std::vector<Step>& feedback, std::vector<Step>& side, std::vector<Step>& inputs);
  std::optional<Waiting> waitingFor(Monotonic now);
  bool finished() const;
  /// Time of the first sample of an input that no batch has taken yet; empty: none.
  std::optional<TimeNs> candidate() const;
  std::uint64_t rejected(int stream) const { return streams_.at(stream).rejected; }
  const StreamSpec& spec(int stream) const { return streams_.at(stream).spec; }

 private:
  struct Stream {
    StreamSpec spec;
    std::deque<TimeNs> queue;
    TimeNs complete_until;                 ///< all samples up to and including this time have arrived
    TimeNs promised_last, promised_until;  ///< the newest promise whose last sample has not arrived yet
    std::uint64_t arrived = 0, rejected = 0;
    std::optional<std::uint64_t> announced;  ///< number of samples by run/end
    bool live() const { return spec.mode == StreamMode::kLive; }
    bool ended() const { return announced && (live() || arrived >= *announced); }
    bool reached(TimeNs t) const { return live() || ended() || complete_until >= t; }
  };
  bool holdsUp(const Stream& stream, std::optional<TimeNs> time) const;
  std::optional<int> blocker() const;
  /// Moves the heads of all streams with `role` up to and including `until` to `out`, sorted. Takes all
  /// samples of live feedback streams.
  void take(StreamRole role, std::optional<TimeNs> until, std::vector<Step>& out);

  std::vector<Stream> streams_;
  std::optional<TimeNs> previous_;  ///< time of the last batch with a primary sample
  int blocked_by_ = -1;
  std::uint64_t blocked_arrived_ = 0;
  TimeNs blocked_until_ = 0;
  Monotonic blocked_since_{};
};

/// Merges the streams of one stage. Payload is the type that the stage takes, e.g. a std::variant of its
/// input types or a FrameView. Not thread-safe. Call push() once per arriving sample. Has no clock of its
/// own.
///
///   while (reader->take(sample)) merger.push(local_map, time, sample);
///   while (merger.nextBatch(batch)) process(batch);
///
/// A batch at time t is released when every lockstep input and side stream has reached t or has ended, and
/// when every feedback stream has delivered all samples up to the previous primary time. A stream has reached
/// t when a sample or a watermark shows that no sample up to t is missing. The same samples give the same
/// batches, however the arrivals interleave.
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
    std::vector<Item> side;  ///< times < time, in (time, robot, rank) order
    std::vector<Item> inputs;  ///< at `time`, in (robot, rank) order; never empty
  };

  /// @return the number of the stream. Add all streams before the first push.
  int addStream(StreamSpec spec) {
    queues_.emplace_back();
    return order_.add(std::move(spec));
  }
  /// Returns false when `time` is not later than the last sample or watermark of the stream. The sample is
  /// then dropped and counted as rejected; it still counts as arrived.
  bool push(int stream, TimeNs time, Payload payload) {
    if (!order_.push(stream, time)) return false;
    queues_[stream].push_back(std::move(payload));
    return true;
  }
  /// Watermark: all samples of the stream up to and including this time have been pushed or will never
  /// arrive.
  void advance(int stream, TimeNs watermark) { order_.advance(stream, watermark); }
  /// Time of the next batch, which may still be waiting for a stream; empty: no input has a sample.
  std::optional<TimeNs> nextTime() const { return order_.candidate(); }
  /// A watermark that may arrive before the samples. After the sample at `last`, which may not have arrived
  /// yet, there is none up to and including `until`. The newest promise counts. Live streams ignore promises.
  void promise(int stream, TimeNs last, TimeNs until) { order_.promise(stream, last, until); }
  /// The count of run/end, which may arrive before the samples: the stream ends when this many have arrived.
  void end(int stream, std::uint64_t sample_count) { order_.end(stream, sample_count); }
  /// One-loan rule of frame streams: take one frame only when this returns true.
  bool wants(int stream) const { return order_.wants(stream); }

  /// Moves the next batch into `batch` and reuses its vectors. Returns false when a stream is not complete
  /// yet.
  bool nextBatch(Batch& batch) {
    if (!order_.next(batch.time, feedback_, side_, inputs_)) return false;
    fill(feedback_, batch.feedback);
    fill(side_, batch.side);
    fill(inputs_, batch.inputs);
    return true;
  }

  /// The stream that blocks the next batch, and for how long by the caller's monotonic clock. Empty when
  /// finished or when only live streams are missing. Call regularly: durations are measured between calls.
  std::optional<Waiting> waitingFor(TimeOrder::Monotonic now) { return order_.waitingFor(now); }
  /// True when every lockstep input has ended and all batches were returned. Unused feedback and side rows
  /// may remain.
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
