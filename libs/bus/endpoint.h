#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>

namespace omnifleet::bus {

/// What is known of a sample beside its fields.
struct SampleInfo {
  std::uint64_t writer = 0;    ///< identifies the writing endpoint within this process
  std::int64_t source_ns = 0;  ///< the writer's clock when it wrote; diagnostics only
};

/// Since the reader was made.
struct ReaderCounters {
  std::uint64_t received = 0;  ///< handed to the caller
  std::uint64_t lost = 0;      ///< known to have been written and never to arrive
  std::uint64_t rejected = 0;  ///< dropped: their writer was built from another IDL (layout guard)
};

/// Type-erased ends, implemented by each bus. Not for services: use Writer<T> and Reader<T>.
class WriterPort {
 public:
  virtual ~WriterPort() = default;
  virtual bool write(const void* sample) = 0;
  virtual void whileFull(std::function<void()>) {}  // where writes never wait
  virtual int matched() const = 0;
  virtual bool waitForReaders(int count, std::chrono::nanoseconds timeout) = 0;
  virtual const std::string& error() const = 0;
};

class ReaderPort {
 public:
  virtual ~ReaderPort() = default;
  virtual bool take(void* sample, SampleInfo& info) = 0;
  virtual int matched() const = 0;
  virtual int alive() const = 0;
  virtual bool waitForWriters(int count, std::chrono::nanoseconds timeout) = 0;
  virtual ReaderCounters counters() const = 0;
};

/// Writes samples of one topic. Not thread-safe; must not outlive its bus.
template <class T>
class Writer {
 public:
  explicit Writer(std::unique_ptr<WriterPort> port) : port_(std::move(port)) {}

  /// Puts a copy on the bus. A full keep-all history is retried until the bus's write timeout, or for 0.2 s
  /// once the bus is stopping. False: not written, error() tells why.
  [[nodiscard]] bool write(const T& sample) { return port_->write(&sample); }
  /// Done again and again while a write waits for room. Stages that write to one another in a ring must take
  /// here what the others write, or all wait for ever; nothing may be written here.
  void whileFull(std::function<void()> action) { port_->whileFull(std::move(action)); }

  /// Readers matched now.
  int matched() const { return port_->matched(); }
  /// True as soon as `count` readers have matched; false on timeout or when the bus is stopping.
  bool waitForReaders(int count, std::chrono::nanoseconds timeout) {
    return port_->waitForReaders(count, timeout);
  }
  /// Why the last write failed; empty after a good one.
  const std::string& error() const { return port_->error(); }

 private:
  std::unique_ptr<WriterPort> port_;
};

/// Takes samples of one topic. Not thread-safe; must not outlive its bus.
template <class T>
class Reader {
 public:
  explicit Reader(std::unique_ptr<ReaderPort> port) : port_(std::move(port)) {}

  /// Moves the oldest sample into the caller's object (its buffers are reused). False: nothing there.
  bool take(T& sample, SampleInfo& info) { return port_->take(&sample, info); }
  bool take(T& sample) {
    SampleInfo info;
    return take(sample, info);
  }

  /// Writers matched now (those of another IDL included; their samples are dropped).
  int matched() const { return port_->matched(); }
  /// Writers alive by their liveliness; equals matched() on topics without a lease.
  int alive() const { return port_->alive(); }
  bool waitForWriters(int count, std::chrono::nanoseconds timeout) {
    return port_->waitForWriters(count, timeout);
  }
  ReaderCounters counters() const { return port_->counters(); }

 private:
  std::unique_ptr<ReaderPort> port_;
};

}  // namespace omnifleet::bus
