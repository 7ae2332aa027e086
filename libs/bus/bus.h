#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "bus/endpoint.h"
#include "bus/frame_channel.h"
#include "bus/topic.h"
#include "bus/type_descriptor.h"

namespace omnifleet::bus {

/// Payload of samples on topics that other hosts read (QosProfile::off_host), since the bus was created.
struct Traffic {
  std::uint64_t out_bytes = 0;  ///< written while a reader was matched; each sample is counted once
  std::uint64_t in_bytes = 0;   ///< taken, from any host
};

/// One DDS participant: the only interface through which a stage communicates. DdsBus connects processes,
/// FakeBus connects stages within one process.
///
/// Robot topics: writer(topic, robot) writes into partitions {"", robot}. reader(topic, robot) reads {robot}
/// only; reader(topic) reads all robots. For topics that belong to no robot, `robot` is empty at both ends.
class Bus {
 public:
  virtual ~Bus() = default;

  template <class T>
  std::unique_ptr<Writer<T>> writer(const Topic<T>& topic, const std::string& robot = {}) {
    return std::make_unique<Writer<T>>(writerPort(topic.name, topic.qos, describe<T>(), robot));
  }
  template <class T>
  std::unique_ptr<Reader<T>> reader(const Topic<T>& topic, const std::string& robot = {}) {
    return std::make_unique<Reader<T>>(readerPort(topic.name, topic.qos, describe<T>(), robot));
  }

  /// The frames of one camera. Both ends derive `bytes_needed` (width × height × channels) from its
  /// calibration. Frames stay on this host.
  virtual std::unique_ptr<FrameWriter> frameWriter(const std::string& camera_id,
                                                   std::size_t bytes_needed) = 0;
  virtual std::unique_ptr<FrameReader> frameReader(const std::string& camera_id,
                                                   std::size_t bytes_needed) = 0;

  /// Sleeps until an event: a sample or a match since the last wait(), or wake(). Returns false when the
  /// timeout has passed. Edge-triggered: take all samples, then wait.
  virtual bool wait(std::chrono::nanoseconds timeout) = 0;
  /// Ends a wait(). Async-signal-safe, thread-safe.
  virtual void wake() noexcept = 0;
  /// Makes blocked writes and waits for matches return soon (see Writer::write). Async-signal-safe; wakes.
  virtual void requestStop() noexcept = 0;
  virtual bool stopping() const noexcept = 0;
  /// Waits until every reliable reader has received all written samples (frames: has taken them), so that no
  /// sample is lost when this bus is destroyed. Includes the readers of participants that were discovered
  /// recently and are not matched yet. Returns false on timeout or stop.
  virtual bool flush(std::chrono::nanoseconds timeout) = 0;

  virtual Traffic traffic() const = 0;
  /// The process that owns the robot of this bus, if that is another one ("process 4711 on host b"): two
  /// processes claim to be the same stage of the same robot (robot_claim.h). Meanwhile all writers discard
  /// their samples, except those with QosProfile::while_outranked. Empty: this process is the owner, or
  /// claims no robot.
  virtual std::string rival() const { return {}; }

 protected:
  virtual std::unique_ptr<WriterPort> writerPort(const std::string& topic, const QosProfile& qos,
                                                 const TypeDescriptor& type, const std::string& robot) = 0;
  virtual std::unique_ptr<ReaderPort> readerPort(const std::string& topic, const QosProfile& qos,
                                                 const TypeDescriptor& type, const std::string& robot) = 0;
};

/// Receives one line for the log, e.g. that a writer with another IDL was found. Called from any thread.
using Report = std::function<void(const std::string& line)>;

}  // namespace omnifleet::bus
