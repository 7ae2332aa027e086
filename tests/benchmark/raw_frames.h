#pragma once

#include <cstdint>
#include <memory>
#include <string>

namespace omnifleet::bench {

enum class RawTransport {
  kUdp,           ///< UDP alone, on the loopback, 4 MB socket buffers
  kSharedMemory,  ///< Fast DDS's shared-memory transport, 16 MB segment; no data-sharing
};

/// Frames over plain Fast DDS: the project's own frame type and histories (reliable, keep all 8), but through
/// a transport, which copies, instead of data-sharing.
class RawFrameWriter {
 public:
  RawFrameWriter(RawTransport transport, int domain, std::size_t bytes);
  ~RawFrameWriter();
  std::uint8_t* pixels();
  /// `stamp_ns` travels with the frame.
  bool write(std::int64_t stamp_ns);
  bool waitForReader(int seconds);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

class RawFrameReader {
 public:
  RawFrameReader(RawTransport transport, int domain, std::size_t bytes);
  ~RawFrameReader();
  /// Blocks until a frame was copied into the reader's own memory. False on timeout.
  bool take(std::int64_t& stamp_ns, const std::uint8_t*& pixels, int timeout_s);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace omnifleet::bench
