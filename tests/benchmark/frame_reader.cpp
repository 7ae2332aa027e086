// Reading process of the transport benchmark: takes frames and prints for each its latency (ms) and 1 if it
// arrived intact, else 0.
//   omnifleet_bench_reader live|replay|udp|shm DOMAIN BYTES COUNT

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>

#include "bus/dds_bus.h"
#include "tests/benchmark/measure.h"
#include "tests/benchmark/raw_frames.h"

namespace omnifleet::bench {
namespace {

constexpr int kTimeout_s = 20;

/// True if the first byte of every KiB is what the writer wrote: the low byte of the frame's number.
bool intact(const std::uint8_t* pixels, std::size_t bytes, int number) {
  for (std::size_t i = 0; i < bytes; i += 1024) {
    if (pixels[i] != static_cast<std::uint8_t>(number)) return false;
  }
  return true;
}

void answer(double latency_ms, bool good) {
  std::printf("%.6f %d\n", latency_ms, good ? 1 : 0);
  std::fflush(stdout);
}

/// The writer matches this reader before this reader matches the writer. A best-effort frame that is written
/// in between is lost, so the writer waits for this signal.
void signalReady() {
  std::puts("ready");
  std::fflush(stdout);
}

int readLoans(bus::RunMode mode, int domain, std::size_t bytes, int count) {
  bus::DdsBusOptions options;
  options.domain = domain;
  options.mode = mode;
  const auto dds = bus::makeDdsBus(options);
  const auto reader = dds->frameReader("bench", bytes);
  if (!reader->waitForWriters(1, std::chrono::seconds(kTimeout_s))) return 1;
  signalReady();
  for (int n = 0; n < count; ++n) {
    auto frame = reader->take();
    while (!frame) {
      if (!dds->wait(std::chrono::seconds(kTimeout_s))) return 1;
      frame = reader->take();
    }
    const double latency_ms = 1e-6 * static_cast<double>(hostNs() - frame->header.acquired_ns);
    answer(latency_ms, intact(frame->data, bytes, n) && reader->stillValid());
    reader->release();
  }
  return 0;
}

int readRaw(RawTransport transport, int domain, std::size_t bytes, int count) {
  RawFrameReader reader(transport, domain, bytes);
  signalReady();  // needs no match: reliable frames are repeated
  for (int n = 0; n < count; ++n) {
    std::int64_t stamp_ns = 0;
    const std::uint8_t* pixels = nullptr;
    if (!reader.take(stamp_ns, pixels, kTimeout_s)) return 1;
    answer(1e-6 * static_cast<double>(hostNs() - stamp_ns), intact(pixels, bytes, n));
  }
  return 0;
}

}  // namespace
}  // namespace omnifleet::bench

int main(int argc, char** argv) {
  using namespace omnifleet::bench;
  if (argc != 5) return 2;
  const std::string kind = argv[1];
  const int domain = std::atoi(argv[2]), count = std::atoi(argv[4]);
  const auto bytes = static_cast<std::size_t>(std::atoll(argv[3]));
  if (kind == "live") return readLoans(omnifleet::bus::RunMode::kLive, domain, bytes, count);
  if (kind == "replay") return readLoans(omnifleet::bus::RunMode::kReplay, domain, bytes, count);
  return readRaw(kind == "udp" ? RawTransport::kUdp : RawTransport::kSharedMemory, domain, bytes, count);
}
