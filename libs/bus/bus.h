#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "bus/endpoint.h"
#include "bus/frame_channel.h"
#include "bus/topic.h"
#include "bus/type_descriptor.h"

namespace omnifleet::bus {

/// One participant: the only way by which a stage speaks. DdsBus in processes, FakeBus within one process.
///
/// Robot topics: writer(topic, robot) writes into partitions {"", robot}; reader(topic, robot) reads {robot}
/// only; reader(topic) reads everybody. Topics that belong to no robot leave `robot` empty on both ends.
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

  /// The frames of one camera; `bytes_needed` is width × height × channels of its calibration, which both
  /// ends know. Frames stay on this host.
  virtual std::unique_ptr<FrameWriter> frameWriter(const std::string& camera_id,
                                                   std::size_t bytes_needed) = 0;
  virtual std::unique_ptr<FrameReader> frameReader(const std::string& camera_id,
                                                   std::size_t bytes_needed) = 0;

  /// Sleeps until something happened on any reader or match since the last wait(), wake() was called, or the
  /// timeout passed (then false). Edge-triggered: take until nothing is left, then wait.
  virtual bool wait(std::chrono::nanoseconds timeout) = 0;
  /// Ends a wait(). Async-signal-safe, thread-safe.
  virtual void wake() noexcept = 0;
  /// From now on blocked writes and waits for matches give up soon. Async-signal-safe; wakes.
  virtual void requestStop() noexcept = 0;
  virtual bool stopping() const noexcept = 0;
  /// Waits until every reliable reader has what was written (frames: has taken it), so that nothing is lost
  /// when this bus goes away; also those of participants that were found so lately that their readers do not
  /// match yet. False on timeout or stop.
  virtual bool flush(std::chrono::nanoseconds timeout) = 0;

 protected:
  virtual std::unique_ptr<WriterPort> writerPort(const std::string& topic, const QosProfile& qos,
                                                 const TypeDescriptor& type, const std::string& robot) = 0;
  virtual std::unique_ptr<ReaderPort> readerPort(const std::string& topic, const QosProfile& qos,
                                                 const TypeDescriptor& type, const std::string& robot) = 0;
};

/// One line for people, e.g. that a writer of another IDL was found. Called from any thread.
using Report = std::function<void(const std::string& line)>;

}  // namespace omnifleet::bus
