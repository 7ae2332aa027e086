#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "adapters/adapters.h"
#include "bus/service.h"
#include "common/run_ends.h"

namespace omnifleet::services {

/// What became of a sample: taken; not to be believed, but its place in the line is kept by an invalid one;
/// or thrown away.
enum class Taken { kGood, kInvalid, kRejected };
inline Taken asTaken(Taken taken) {
  return taken;
}
inline Taken asTaken(bool good) {
  return good ? Taken::kGood : Taken::kRejected;
}
/// For the samples of which a stage owes its readers one per frame: adapters leave an invalid one behind.
inline Taken orInvalid(bool good) {
  return good ? Taken::kGood : Taken::kInvalid;
}

/// One input of a stage: a reader, its stream in the stage's TimeMerger and its end. `Wire` has a header().
template <class Wire, class Payload>
class Inlet {
 public:
  /// Declares the stream. `end_name` is the stream's name on run/end.
  Inlet(std::unique_ptr<bus::Reader<Wire>> reader, bus::TimeMerger<Payload>& merger, RunEnds& ends,
        bus::StreamSpec spec)
      : reader_(std::move(reader)), merger_(merger) {
    const std::string end_name = spec.name;
    stream_ = merger_.addStream(std::move(spec));
    ends.listen(end_name, [this](TimeNs last, std::uint64_t) { end_ns_ = last; });
  }
  Inlet(const Inlet&) = delete;
  Inlet& operator=(const Inlet&) = delete;

  /// Moves all that has arrived into the merger. `convert(wire, payload)` says what became of a sample (or
  /// true, false: good, rejected); all but the good ones are counted and told. Returns samples taken.
  template <class Convert>
  int pull(bus::StatusBoard& status, Convert convert) {
    int taken = 0;
    while (reader_->take(sample_)) {
      ++taken;
      Payload payload;
      const Taken as = asTaken(convert(sample_, payload));
      if (as != Taken::kGood) {
        status.dropped();
        status.error(merger_.spec(stream_).name +
                     ": a sample with a non-finite or unknown value was rejected");
      }
      if (as == Taken::kRejected) continue;
      if (!merger_.push(stream_, sample_.header().acquired_ns(), std::move(payload))) {
        status.dropped();
        status.error(merger_.spec(stream_).name + ": a sample out of order was rejected");
      }
      last_ns_ = std::max(last_ns_, sample_.header().acquired_ns());
    }
    if (end_ns_ && last_ns_ >= *end_ns_) {
      merger_.end(stream_, 0);
      end_ns_.reset();
      ++taken;
    }
    return taken;
  }

  int stream() const { return stream_; }
  const bus::Reader<Wire>& reader() const { return *reader_; }

 private:
  std::unique_ptr<bus::Reader<Wire>> reader_;
  bus::TimeMerger<Payload>& merger_;
  int stream_ = -1;
  TimeNs last_ns_ = RunEnds::kNothing;
  std::optional<TimeNs> end_ns_;
  Wire sample_;
};

/// The writer of one output stream with its count, for run/end.
template <class Wire>
class Outlet {
 public:
  Outlet(std::unique_ptr<bus::Writer<Wire>> writer, std::string name, int readers)
      : writer_(std::move(writer)), name_(std::move(name)), readers_(readers) {}

  bus::Expectation expectation() const {
    return {name_ + " read by " + std::to_string(readers_) + " stages",
            [this] { return writer_->matched() >= readers_; }};
  }

  /// Of a stage that its readers write to in turn: done while a write waits for them (bus::Writer::whileFull).
  void whileFull(std::function<void()> action) { writer_->whileFull(std::move(action)); }

  /// Writes and counts; a failure goes to the status.
  bool write(const Wire& sample, bus::StatusBoard& status) {
    if (!writer_->write(sample)) {
      status.dropped();
      status.error(name_ + ": " + writer_->error());
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

/// What every stage reads of its surroundings once.
bus::StreamMode streamMode(const bus::ServiceOptions& options);
adapters::RunClock runClock(const bus::ServiceOptions& options);

}  // namespace omnifleet::services
