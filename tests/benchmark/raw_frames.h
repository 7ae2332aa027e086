#pragma once

#include <cstdint>
#include <memory>
#include <string>

namespace omnifleet::bench {

enum class RawTransport {
  kUdp,           ///< UDP only, loopback, socket buffers of 4 MiB
  kSharedMemory,  ///< shared-memory transport of Fast DDS, segment of 16 MiB, no data-sharing
};

/// Frames over plain Fast DDS. Frame types and histories (reliable, keep all 8) are those of this project. A
/// transport copies the frames, where this project uses data-sharing.
class RawFrameWriter {
 public:
  RawFrameWriter(RawTransport transport, int domain, std::size_t bytes);
  ~RawFrameWriter();
  std::uint8_t* pixels();
  /// Sends the frame with `stamp_ns`. Returns false if the history stays full.
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
  /// Blocks until a frame has been copied into the reader's memory. Returns false on timeout.
  bool take(std::int64_t& stamp_ns, const std::uint8_t*& pixels, int timeout_s);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace omnifleet::bench
