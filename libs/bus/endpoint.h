#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>

namespace omnifleet::bus {

/// Metadata of a sample.
struct SampleInfo {
  std::uint64_t writer = 0;    ///< identifies the writing endpoint within this process
  std::int64_t source_ns = 0;  ///< clock of the writer at the time of writing; diagnostics only
};

/// Counted since the reader was created.
struct ReaderCounters {
  std::uint64_t received = 0;  ///< handed to the caller
  std::uint64_t lost = 0;      ///< written, but never to arrive
  std::uint64_t rejected = 0;  ///< dropped because their writer was built from another IDL (layout guard)
};

/// Type-erased endpoints, implemented by each bus. Services use Writer<T> and Reader<T>.
class WriterPort {
 public:
  virtual ~WriterPort() = default;
  virtual bool write(const void* sample) = 0;
  virtual void whileFull(std::function<void()>) {}  // default for buses whose writes never wait
  virtual int matched() const = 0;
  virtual bool waitForReaders(int count, std::chrono::nanoseconds timeout) = 0;
  virtual const std::string& error() const = 0;
};

class ReaderPort {
 public:
  virtual ~ReaderPort() = default;
  virtual bool take(void* sample, SampleInfo& info) = 0;
  virtual int matched() const = 0;
  virtual bool waitForWriters(int count, std::chrono::nanoseconds timeout) = 0;
  virtual ReaderCounters counters() const = 0;
};

/// Writes samples of one topic. Not thread-safe; must not outlive its bus.
template <class T>
class Writer {
 public:
  explicit Writer(std::unique_ptr<WriterPort> port) : port_(std::move(port)) {}

  /// Writes a copy of the sample. Retries while a keep-all history is full: until the write timeout of the
  /// bus, or for 0.2 s once the bus is stopping. Returns false when the sample was not written; error() has
  /// the reason.
  [[nodiscard]] bool write(const T& sample) { return port_->write(&sample); }
  /// Sets an action that is repeated while a write waits for room. Stages that write to each other in a ring
  /// must take each other's samples here. This prevents deadlock. The action must not write.
  void whileFull(std::function<void()> action) { port_->whileFull(std::move(action)); }

  /// Number of matched readers.
  int matched() const { return port_->matched(); }
  /// Returns true as soon as `count` readers are matched, false on timeout or when the bus is stopping.
  bool waitForReaders(int count, std::chrono::nanoseconds timeout) {
    return port_->waitForReaders(count, timeout);
  }
  /// Reason of the last failed write; empty after a successful one.
  const std::string& error() const { return port_->error(); }

 private:
  std::unique_ptr<WriterPort> port_;
};

/// Takes samples of one topic. Not thread-safe; must not outlive its bus.
template <class T>
class Reader {
 public:
  explicit Reader(std::unique_ptr<ReaderPort> port) : port_(std::move(port)) {}

  /// Moves the oldest sample into `sample` and reuses its buffers. Returns false when there is none.
  bool take(T& sample, SampleInfo& info) { return port_->take(&sample, info); }
  bool take(T& sample) {
    SampleInfo info;
    return take(sample, info);
  }

  /// Number of matched writers, including those of another IDL (their samples are dropped).
  int matched() const { return port_->matched(); }
  bool waitForWriters(int count, std::chrono::nanoseconds timeout) {
    return port_->waitForWriters(count, timeout);
  }
  ReaderCounters counters() const { return port_->counters(); }

 private:
  std::unique_ptr<ReaderPort> port_;
};

}  // namespace omnifleet::bus
