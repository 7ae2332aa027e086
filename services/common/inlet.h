#pragma once

#include <algorithm>
#include <chrono>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "adapters/adapters.h"
#include "bus/service.h"
#include "common/messages.h"
#include "common/run_ends.h"
#include "common/source_times.h"
#include "fleet/fleet.h"
#include "observation/time_range.h"

namespace omnifleet::services {

/// Result of the conversion of a sample. kGood: valid. kInvalid: invalid, but an invalid sample keeps its
/// place in the stream. kRejected: dropped. kIgnored: dropped, and no fault.
enum class Validity { kGood, kInvalid, kRejected, kIgnored };
inline Validity asValidity(Validity validity) {
  return validity;
}
inline Validity asValidity(bool good) {
  return good ? Validity::kGood : Validity::kRejected;
}
/// For streams with exactly one sample per frame: adapters replace a bad sample by an invalid one.
inline Validity orInvalid(bool good) {
  return good ? Validity::kGood : Validity::kInvalid;
}

/// One input of a stage: a reader, its stream in the TimeMerger of the stage, and its end. `Wire` has a
/// header().
template <class Wire, class Payload>
class Inlet {
 public:
  /// Adds the stream to `merger`. spec.name is also its name on run/end.
  Inlet(std::unique_ptr<bus::Reader<Wire>> reader, bus::TimeMerger<Payload>& merger, RunEnds& ends,
        bus::StreamSpec spec)
      : reader_(std::move(reader)), merger_(merger) {
    const std::string end_name = spec.name;
    is_live_ = spec.mode == bus::StreamMode::kLive;
    stream_ = merger_.addStream(std::move(spec));
    ends.listen(end_name, [this](TimeNs last, std::uint64_t) {
      end_ns_ = last;
      end_heard_ = std::chrono::steady_clock::now();
    });
  }
  Inlet(const Inlet&) = delete;
  Inlet& operator=(const Inlet&) = delete;

  /// From now on the samples have the times of `times`, which must outlive this. Null: their own.
  void follow(SourceTimes* times) { times_ = times; }

  /// Moves all arrived samples into the merger. `convert(wire, payload)` returns the Validity of a sample, or
  /// a bool (true: good, false: rejected). Samples that are not good are counted and reported. @return number
  /// of samples taken
  template <class Convert>
  int pull(bus::StatusBoard& status, Convert convert) {
    int taken = 0;
    while (reader_->take(sample_)) {
      ++taken;
      if (times_ != nullptr) sample_.header().acquired_ns(times_->toRun(sample_.header().acquired_ns()));
      Payload payload;
      const Validity validity = asValidity(convert(sample_, payload));
      if (validity == Validity::kIgnored) continue;
      if (validity != Validity::kGood) {
        status.dropped();
        status.report(sampleRejected(merger_.spec(stream_).name));
      }
      if (validity == Validity::kRejected) continue;
      const TimeNs time = sample_.header().acquired_ns();
      if (merger_.push(stream_, time, std::move(payload))) {
        remember(time);
      } else {
        status.dropped();
        if (!isRepeated(time)) status.report(sampleOutOfOrder(merger_.spec(stream_).name));
      }
      if (last_ns_ == RunEnds::kNothing) first_ns_ = sample_.header().acquired_ns();
      last_ns_ = std::max(last_ns_, sample_.header().acquired_ns());
    }
    if (end_ns_ && (last_ns_ >= *end_ns_ || isOverdue())) {
      if (last_ns_ < *end_ns_) status.report(lastSamplesMissing(merger_.spec(stream_).name));
      merger_.end(stream_, 0);
      end_ns_.reset();
      ++taken;
    }
    return taken;
  }

  int stream() const { return stream_; }
  bool receivedAny() const { return last_ns_ != RunEnds::kNothing; }
  /// Acquisition times of the first and the latest sample; empty: none has arrived.
  std::optional<TimeRange> times() const {
    return receivedAny() ? std::optional(TimeRange{first_ns_, last_ns_}) : std::nullopt;
  }
  /// The same; valid if receivedAny().
  TimeNs firstNs() const { return first_ns_; }
  TimeNs lastNs() const { return last_ns_; }
  const bus::Reader<Wire>& reader() const { return *reader_; }

 private:
  /// Live, samples may be lost, also the last one of a stream. This bound prevents a deadlock.
  bool isOverdue() const {
    constexpr std::chrono::seconds kOnTheWay{2};  // samples that run/end has overtaken
    return is_live_ && std::chrono::steady_clock::now() - end_heard_ >= kOnTheWay;
  }
  void remember(TimeNs time) {
    constexpr std::size_t kRemembered = 64;
    accepted_.push_back(time);
    if (accepted_.size() > kRemembered) accepted_.pop_front();
  }
  /// A restarted publisher repeats the last frames of its previous incarnation once, which is no fault. A
  /// clock that stands still repeats a time again and again.
  bool isRepeated(TimeNs time) {
    const auto at = std::find(accepted_.begin(), accepted_.end(), time);
    if (at == accepted_.end()) return false;
    accepted_.erase(at);
    return true;
  }

  std::unique_ptr<bus::Reader<Wire>> reader_;
  bus::TimeMerger<Payload>& merger_;
  SourceTimes* times_ = nullptr;
  int stream_ = -1;
  TimeNs first_ns_ = 0;
  TimeNs last_ns_ = RunEnds::kNothing;
  std::optional<TimeNs> end_ns_;
  std::chrono::steady_clock::time_point end_heard_{};
  bool is_live_ = false;
  Wire sample_;
  std::deque<TimeNs> accepted_;  ///< times of the latest samples that were not repeated yet
};

/// The writer of one output stream and its sample count for run/end.
template <class Wire>
class Outlet {
 public:
  Outlet(std::unique_ptr<bus::Writer<Wire>> writer, std::string name, int readers)
      : writer_(std::move(writer)), name_(std::move(name)), readers_(readers) {}

  bus::Expectation expectation() const {
    return {std::to_string(readers_) + (readers_ == 1 ? " reader of " : " readers of ") + name_,
            [this] { return writer_->matched() >= readers_; }};
  }

  /// For stages whose readers also write to them: repeated while a write waits (bus::Writer::whileFull).
  void whileFull(std::function<void()> action) { writer_->whileFull(std::move(action)); }

  /// Writes and counts one sample. Reports a failure to the status.
  bool write(const Wire& sample, bus::StatusBoard& status) {
    if (!writer_->write(sample)) {
      status.dropped();
      status.report(writeFailed(name_, writer_->error()));
      return false;
    }
    last_ns_ = sample.header().acquired_ns();
    ++samples_;
    return true;
  }

  void end(RunEnds& ends, const std::string& reason = {}) {
    if (!ended_) ends.announce(name_, last_ns_, samples_, reason);
    ended_ = true;
  }
  std::uint64_t samples() const { return samples_; }
  int matched() const { return writer_->matched(); }

 private:
  std::unique_ptr<bus::Writer<Wire>> writer_;
  std::string name_;
  int readers_;
  TimeNs last_ns_ = RunEnds::kNothing;
  std::uint64_t samples_ = 0;
  bool ended_ = false;
};

/// Properties of the run that every stage reads once.
bus::StreamMode streamMode(const bus::ServiceOptions& options);
/// The clock of the run's acquisition times. Of live runs it is the system clock.
adapters::RunClock runClock(const bus::ServiceOptions& options);
/// Knows more about live runs: a simulation has its own clock, and a recording keeps its own.
adapters::RunClock runClock(const bus::ServiceOptions& options, const fleet::Fleet& fleet);

}  // namespace omnifleet::services
