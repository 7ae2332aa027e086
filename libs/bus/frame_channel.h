#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "observation/observation.h"

namespace omnifleet::bus {

/// Which clock `acquired_ns` is read from (the values of v1::Header).
enum class ClockId : std::uint8_t { kSystem = 0, kDataset = 1, kSim = 2 };

/// Beside the pixels. Rows are packed: stride = width × channels bytes; BGR (3) or grey (1), top row first.
struct FrameHeader {
  TimeNs acquired_ns = 0;
  ClockId clock = ClockId::kSystem;
  std::uint32_t sequence = 0;
  FrameState state = FrameState::kOk;  ///< an invalid frame goes down the line too; its size may be 0 × 0
  int width_px = 0;
  int height_px = 0;
  int channels = 3;

  std::size_t bytes() const { return static_cast<std::size_t>(width_px) * height_px * channels; }
};

/// A frame in the writer's memory, on loan: not to be written, gone after FrameReader::release().
struct FrameView {
  FrameHeader header;
  const std::uint8_t* data = nullptr;
};

/// Writes the frames of one camera. The pixels are produced straight in the loan. Not thread-safe. Where no
/// frame may be lost, wait for the readers first: what is written before a reader has matched reaches it with
/// the next frame only.
class FrameWriter {
 public:
  virtual ~FrameWriter() = default;

  /// A loan of header.bytes() to be filled; nullptr when every slot is taken (try again later) or error() is
  /// set (the frame is larger than the channel). At most one loan at a time: an open one is abandoned first.
  virtual std::uint8_t* begin(const FrameHeader& header) = 0;
  /// For what is found while decoding: replaces the header of the open loan; it may not grow.
  virtual void amend(const FrameHeader& header) = 0;
  /// Sends the open loan. Retries like Writer<T>::write. False: not sent, error() tells why.
  [[nodiscard]] virtual bool publish() = 0;
  /// Gives the open loan back unsent.
  virtual void abandon() = 0;

  virtual int matched() const = 0;
  virtual bool waitForReaders(int count, std::chrono::nanoseconds timeout) = 0;
  virtual const std::string& error() const = 0;
};

struct FrameCounters {
  std::uint64_t received = 0;
  std::uint64_t lost = 0;      ///< gaps in the sequence as seen here
  std::uint64_t torn = 0;      ///< overwritten while held
  std::uint64_t rejected = 0;  ///< layout guard
};

/// Reads the frames of one camera, one loan at a time. Not thread-safe.
class FrameReader {
 public:
  virtual ~FrameReader() = default;

  /// The oldest frame; nothing while a loan is held. A frame that was overwritten before it could be taken is
  /// counted as torn and skipped.
  virtual std::optional<FrameView> take() = 0;
  /// To be asked after the pixels were used: false when they were overwritten meanwhile (live mode); counted.
  virtual bool stillValid() = 0;
  /// Gives the loan back.
  virtual void release() = 0;
  virtual bool holding() const = 0;

  virtual int matched() const = 0;
  virtual bool waitForWriters(int count, std::chrono::nanoseconds timeout) = 0;
  virtual FrameCounters counters() const = 0;
};

/// The frame types of the wire.
struct FrameClass {
  const char* name;      ///< "Frame1M", "Frame4M" or "Frame12M"
  std::size_t capacity;  ///< bytes of pixels
};

/// The smallest class that holds so many bytes of pixels. Throws std::runtime_error above the largest.
FrameClass frameClassFor(std::size_t bytes_needed);

}  // namespace omnifleet::bus
