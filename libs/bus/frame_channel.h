#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "observation/observation.h"

namespace omnifleet::bus {

/// The clock of `acquired_ns` (values of v1::Header).
enum class ClockId : std::uint8_t { kSystem = 0, kDataset = 1, kSim = 2 };

/// Metadata of a frame. Rows are packed: stride = width × channels bytes. Pixels are BGR (3) or grey (1), top
/// row first.
struct FrameHeader {
  TimeNs acquired_ns = 0;
  ClockId clock = ClockId::kSystem;
  std::uint32_t sequence = 0;
  FrameState state = FrameState::kOk;  ///< invalid frames are published too; their size may be 0 × 0
  int width_px = 0;
  int height_px = 0;
  int channels = 3;

  std::size_t bytes() const { return static_cast<std::size_t>(width_px) * height_px * channels; }
};

/// A frame on loan, in the memory of the writer. Read-only; invalid after FrameReader::release().
struct FrameView {
  FrameHeader header;
  const std::uint8_t* data = nullptr;
};

/// Writes the frames of one camera. The caller writes the pixels directly into the loan. Not thread-safe.
/// Wait for the readers first where no frame may be lost: a reader receives earlier frames only with the next
/// frame after its match.
class FrameWriter {
 public:
  virtual ~FrameWriter() = default;

  /// Lends header.bytes() of memory for the pixels. Returns nullptr when all slots are in use (try again
  /// later) or when error() is set (the frame is larger than the channel). Only one loan at a time: an open
  /// loan is abandoned.
  virtual std::uint8_t* begin(const FrameHeader& header) = 0;
  /// Replaces the header of the open loan, for properties that are known only after decoding. The frame must
  /// not grow.
  virtual void amend(const FrameHeader& header) = 0;
  /// Publishes the open loan. Retries like Writer<T>::write. Returns false when the frame was not published;
  /// error() has the reason.
  [[nodiscard]] virtual bool publish() = 0;
  /// Returns the open loan without publishing it.
  virtual void abandon() = 0;

  virtual int matched() const = 0;
  virtual bool waitForReaders(int count, std::chrono::nanoseconds timeout) = 0;
  virtual const std::string& error() const = 0;
};

struct FrameCounters {
  std::uint64_t received = 0;
  std::uint64_t lost = 0;      ///< gaps in the sequence numbers of this reader
  std::uint64_t torn = 0;      ///< overwritten while in use
  std::uint64_t rejected = 0;  ///< dropped by the layout guard
};

/// Reads the frames of one camera, one loan at a time. Not thread-safe.
class FrameReader {
 public:
  virtual ~FrameReader() = default;

  /// The oldest frame; none while a loan is held. A frame that was overwritten before it was taken is counted
  /// as torn and skipped.
  virtual std::optional<FrameView> take() = 0;
  /// Call after using the pixels. Returns false when the writer overwrote them meanwhile (live mode), which
  /// is counted as torn.
  virtual bool stillValid() = 0;
  /// Returns the loan.
  virtual void release() = 0;
  virtual bool holding() const = 0;

  virtual int matched() const = 0;
  virtual bool waitForWriters(int count, std::chrono::nanoseconds timeout) = 0;
  virtual FrameCounters counters() const = 0;
};

/// Frame types of idl/camera.idl.
struct FrameClass {
  const char* name;      ///< "Frame1M", "Frame4M" or "Frame12M"
  std::size_t capacity;  ///< bytes for pixels
};

/// The smallest class that holds `bytes_needed` of pixels. Throws std::runtime_error when none does.
FrameClass frameClassFor(std::size_t bytes_needed);

}  // namespace omnifleet::bus
