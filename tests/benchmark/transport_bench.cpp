// Transport of a frame from one process to another at 30 Hz. The time runs from the call that publishes the
// finished frame until the reader has it. The bus writes into a loan, and the reader reads it in place; the
// peers copy the frame. The bus is measured as in live mode (best effort) and as in replay (reliable, as the
// peers). A reliable frame is acknowledged to the writer through a socket before the reader gets it.

#include <chrono>
#include <cstdio>
#include <cstring>
#include <functional>
#include <string>
#include <thread>

#include "bus/dds_bus.h"
#include "tests/benchmark/benchmarks.h"
#include "tests/benchmark/raw_frames.h"
#include "tests/multiprocess/process.h"

namespace omnifleet::bench {
namespace {

constexpr int kDomain = 93, kTimeout_s = 20;
constexpr auto kPeriod = std::chrono::nanoseconds(1'000'000'000 / 30);
constexpr int kWarmUp = 12;  // frames, so that every slot has been written and read at least once

struct Size {
  const char* name;
  int width, height;
  std::size_t bytes() const { return static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * 3; }
};
const Size kSizes[] = {{"1.2MB", 736, 552}, {"3.7MB", 1280, 960}};

/// Starts the reading process and reads its answers.
class ReaderProcess {
 public:
  ReaderProcess(const std::string& kind, std::size_t bytes, int count) {
    const std::string command = "exec '" + test::testProgram("omnifleet_bench_reader") + "' " + kind + " " +
                                std::to_string(kDomain) + " " + std::to_string(bytes) + " " +
                                std::to_string(count);
    answers_ = popen(command.c_str(), "r");
  }
  ~ReaderProcess() {
    if (answers_) pclose(answers_);
  }
  ReaderProcess(const ReaderProcess&) = delete;
  ReaderProcess& operator=(const ReaderProcess&) = delete;

  /// Waits until the process is ready to read. Returns false if it ended before.
  bool isReady() {
    char word[8] = {};
    return answers_ && std::fscanf(answers_, "%7s", word) == 1 && std::string(word) == "ready";
  }
  /// Reads the latency of the next frame. Returns the error, or an empty string if the frame arrived intact.
  std::string answer(double& latency_ms) {
    int intact = 0;
    if (!answers_ || std::fscanf(answers_, "%lf %d", &latency_ms, &intact) != 2)
      return "a frame did not arrive at the reading process";
    return intact == 1 ? "" : "a frame arrived damaged";
  }

 private:
  std::FILE* answers_ = nullptr;
};

/// Publishes frame n, filled with the low byte of n. Returns false on failure.
using Send = std::function<bool(int n)>;

void run(benchmark::State& state, ReaderProcess& reader, const Send& send) {
  Samples samples(state);
  auto next = std::chrono::steady_clock::now();
  int n = 0;
  const auto one = [&](double& latency_ms) {
    std::this_thread::sleep_until(next += kPeriod);
    const std::string error = send(n++) ? reader.answer(latency_ms) : "a frame could not be published";
    if (!error.empty()) state.SkipWithError(error.c_str());
    return error.empty();
  };
  double latency_ms = 0;
  while (n < kWarmUp) {
    if (!one(latency_ms)) break;
  }
  for (auto _ : state) {
    if (!one(latency_ms)) break;
    samples.add(latency_ms);
  }
  samples.report();
}

void loan(benchmark::State& state, const Size& size, bus::RunMode mode) {
  const char* kind = mode == bus::RunMode::kLive ? "live" : "replay";
  ReaderProcess reader(kind, size.bytes(), kWarmUp + static_cast<int>(state.max_iterations));
  bus::DdsBusOptions options;
  options.domain = kDomain;
  options.mode = mode;
  const auto dds = bus::makeDdsBus(options);
  const auto writer = dds->frameWriter("bench", size.bytes());
  const bool matched = writer->waitForReaders(1, std::chrono::seconds(kTimeout_s));
  if (!matched || !reader.isReady())
    return state.SkipWithError("the reading process did not match the writer within 20 s");
  bus::FrameHeader header;
  header.width_px = size.width;
  header.height_px = size.height;
  run(state, reader, [&](int n) {
    std::uint8_t* pixels = writer->begin(header);
    if (!pixels) return false;
    std::memset(pixels, n & 255, size.bytes());
    header.sequence = static_cast<std::uint32_t>(n);
    header.acquired_ns = hostNs();
    writer->amend(header);
    return writer->publish();
  });
}

void raw(benchmark::State& state, const Size& size, RawTransport transport) {
  const char* kind = transport == RawTransport::kUdp ? "udp" : "shm";
  ReaderProcess reader(kind, size.bytes(), kWarmUp + static_cast<int>(state.max_iterations));
  RawFrameWriter writer(transport, kDomain, size.bytes());
  if (!writer.waitForReader(kTimeout_s) || !reader.isReady())
    return state.SkipWithError("the reading process did not match the writer within 20 s");
  run(state, reader, [&](int n) {
    std::memset(writer.pixels(), n & 255, size.bytes());
    return writer.write(hostNs());
  });
}

}  // namespace

void registerTransport(const Plan& plan) {
  for (const Size& size : kSizes) {
    const auto add = [&](const char* kind, const std::function<void(benchmark::State&)>& body) {
      const std::string name = std::string("frames/") + size.name + "/" + kind;
      benchmark::RegisterBenchmark(name.c_str(),
                                   [body](benchmark::State& state) { guarded(state, [&] { body(state); }); })
          ->Iterations(plan.iterations(300))
          ->UseManualTime()
          ->Unit(benchmark::kMillisecond);
    };
    add("live", [&size](benchmark::State& state) { loan(state, size, bus::RunMode::kLive); });
    add("replay", [&size](benchmark::State& state) { loan(state, size, bus::RunMode::kReplay); });
    add("udp", [&size](benchmark::State& state) { raw(state, size, RawTransport::kUdp); });
    add("shm", [&size](benchmark::State& state) { raw(state, size, RawTransport::kSharedMemory); });
  }
}

}  // namespace omnifleet::bench
