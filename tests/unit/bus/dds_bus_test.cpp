// Behaviour that only DDS has: saturated writers, other vendors, killed processes, files in shared memory.

#include <gmock/gmock.h>
#include <set>
#include <thread>

#include "tests/unit/bus/any_bus.h"
#include "tests/unit/bus/peer_process.h"

namespace omnifleet::bus {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::HasSubstr;
using testing::SizeIs;
using Clock = std::chrono::steady_clock;

DdsBusOptions onOwnDomain(RunMode mode = RunMode::kLockstep) {
  DdsBusOptions options;
  options.domain = ownDomain();
  options.mode = mode;
  return options;
}

TEST(DdsBus, SaturatedWriteFailsAtTimeoutAndContinuesWithRoom) {
  DdsBusOptions options = onOwnDomain();
  options.write_timeout = milliseconds(300);
  const auto a = makeDdsBus(options), b = makeDdsBus(options);
  const Topics topics(RunMode::kLockstep);
  const auto writer = a->writer(topics.pose);
  const auto reader = b->reader(topics.pose);
  ASSERT_TRUE(writer->waitForReaders(1, kPatience));
  int written = 0;
  while (written < 1000 && writer->write(poseOf("r1", written))) ++written;
  // Both histories hold 64 samples of one key. Samples in transit may add a few.
  EXPECT_GE(written, 64);
  EXPECT_LE(written, 2 * 64 + 8);
  EXPECT_THAT(writer->error(), HasSubstr("omnifleet/pose: "));

  std::vector<std::int64_t> got;
  const auto take = [&] {
    for (const auto& pose : receive(*b, *reader, static_cast<std::size_t>(written) - got.size())) {
      got.push_back(pose.header().acquired_ns());
    }
  };
  take();
  for (int more = 0; more < 200; ++more) {
    while (!writer->write(poseOf("r1", written))) take();
    ++written;
  }
  take();
  ASSERT_EQ(static_cast<int>(got.size()), written) << "no sample may be lost";
  for (int k = 0; k < written; ++k) ASSERT_EQ(got[k], k);
}

// As for replicas of the map: each writes more than both histories hold before it reads the other's samples.
TEST(DdsBus, TwoWritersInRingDoNotDeadlock) {
  constexpr int kSamples = 1000;
  const Topics topics(RunMode::kReplay);
  struct Side {
    std::string name, other;
    std::unique_ptr<Bus> bus = {};
    std::unique_ptr<Writer<v1::KeyframePose>> writer = {};
    std::unique_ptr<Reader<v1::KeyframePose>> reader = {};
    std::vector<std::int64_t> got = {};
    int written = 0;
  };
  Side sides[2] = {{"r1", "r2"}, {"r2", "r1"}};
  for (Side& side : sides) {
    DdsBusOptions options = onOwnDomain(RunMode::kReplay);
    options.write_timeout = seconds(5);
    side.bus = makeDdsBus(options);
    side.writer = side.bus->writer(topics.map_keyframe_pose, side.name);
    side.reader = side.bus->reader(topics.map_keyframe_pose, side.other);
  }
  const auto run = [&](Side& side) {
    const auto take = [&side] {
      for (v1::KeyframePose pose; side.reader->take(pose);) side.got.push_back(pose.header().acquired_ns());
    };
    side.writer->whileFull(take);
    v1::KeyframePose pose;
    pose.robot(side.name);
    for (pose.header().acquired_ns(0); side.written < kSamples; ++side.written) {
      if (!side.writer->write(pose)) return;
      pose.header().acquired_ns(side.written + 1);
    }
    const auto deadline = Clock::now() + kPatience;
    for (take(); side.got.size() < kSamples && Clock::now() < deadline; take()) side.bus->wait(seconds(1));
  };
  for (Side& side : sides) ASSERT_TRUE(side.writer->waitForReaders(1, kPatience));
  std::thread other([&] { run(sides[1]); });
  run(sides[0]);
  other.join();
  for (const Side& side : sides) {
    EXPECT_EQ(side.written, kSamples) << side.name << ": " << side.writer->error();
    ASSERT_THAT(side.got, SizeIs(kSamples)) << "written to " << side.name;
    const std::set<std::int64_t> different(
        side.got.begin(), side.got.end());  // replicas form a set, so the order is irrelevant
    EXPECT_THAT(different, SizeIs(kSamples)) << "written to " << side.name;
  }
}

TEST(DdsBus, StopEndsSaturatedWriteWithinOneSecond) {
  const auto a = makeDdsBus(onOwnDomain()), b = makeDdsBus(onOwnDomain());
  const Topics topics(RunMode::kLockstep);
  const auto writer = a->writer(topics.pose);
  const auto reader = b->reader(topics.pose);
  ASSERT_TRUE(writer->waitForReaders(1, kPatience));
  int written = 0;
  Clock::time_point stopped;
  std::thread filler([&] {
    while (writer->write(poseOf("r1", written))) ++written;
  });
  while (reader->counters().received == 0) {
    v1::Pose pose;
    if (!reader->take(pose)) b->wait(seconds(1));
  }
  const auto deadline = Clock::now() + kPatience;
  while (a->flush(milliseconds(50)))
    ASSERT_LT(Clock::now(), deadline);  // the reader takes no more samples, so its history fills up
  stopped = Clock::now();
  a->requestStop();
  filler.join();
  // 0.2 s of retries, one running attempt of 0.1 s, and a margin for a loaded machine.
  EXPECT_LT(Clock::now() - stopped, seconds(1));
}

// A stage that ends during discovery; its last status shows how it ended.
TEST(DdsBus, FlushReachesReadersNotYetDiscovered) {
  const auto b = makeDdsBus(onOwnDomain());
  const Topics topics(RunMode::kLockstep);
  const auto reader = b->reader(topics.service_status);
  {
    const auto a = makeDdsBus(onOwnDomain());
    const auto writer = a->writer(topics.service_status);
    v1::ServiceStatus status;
    status.service("camera");
    ASSERT_TRUE(writer->write(status));
    ASSERT_EQ(writer->matched(), 0) << "no peer is discovered yet";
    EXPECT_TRUE(a->flush(kPatience));
  }
  EXPECT_THAT(receive(*b, *reader, 1), SizeIs(1));
}

TEST(DdsBus, FlushReturnsAtOnceWithKnownPeerWithoutReaders) {
  const auto a = makeDdsBus(onOwnDomain()), b = makeDdsBus(onOwnDomain());
  const Topics topics(RunMode::kLockstep);
  const auto reads_nothing = b->writer(topics.pose);
  const auto reader = a->reader(topics.pose);
  const auto writer = a->writer(topics.service_status);
  ASSERT_TRUE(reader->waitForWriters(1, kPatience));
  ASSERT_TRUE(a->flush(kPatience));  // until discovery of b is complete
  const auto before = Clock::now();
  EXPECT_TRUE(a->flush(kPatience));
  EXPECT_LT(Clock::now() - before, milliseconds(500));
}

TEST(DdsBus, AcceptsSamplesOfWriterWithoutHash) {
  DdsBusOptions foreign = onOwnDomain();
  foreign.announce_hash = false;
  const auto a = makeDdsBus(foreign), b = makeDdsBus(onOwnDomain());
  const Topics topics(RunMode::kLockstep);
  const auto writer = a->writer(topics.pose, "r1");
  const auto reader = b->reader(topics.pose, "r1");
  ASSERT_TRUE(writer->waitForReaders(1, kPatience));
  ASSERT_TRUE(writer->write(poseOf("r1", 5)));
  EXPECT_EQ(receive(*b, *reader, 1).size(), 1u);
  EXPECT_EQ(reader->counters().rejected, 0u);
}

TEST(DdsBus, TransfersLargeSamplesInSmallDatagrams) {
  DdsBusOptions options = onOwnDomain();
  options.max_message_bytes = 1400;
  const auto a = makeDdsBus(options), b = makeDdsBus(options);
  const Topics topics(RunMode::kLive);
  const auto writer = a->writer(topics.map_grid);
  v1::Grid grid;
  grid.map_name("fleet");
  grid.width(1000);
  grid.height(1000);
  grid.cells().resize(1000000);
  for (std::size_t i = 0; i < grid.cells().size(); ++i)
    grid.cells()[i] = static_cast<std::uint8_t>(i * 7 / 3);
  ASSERT_TRUE(writer->write(grid)) << writer->error();
  const auto late = b->reader(topics.map_grid);
  const auto got = receive(*b, *late, 1);
  ASSERT_EQ(got.size(), 1u);
  EXPECT_TRUE(got[0] == grid);
}

std::optional<FrameView> next(Bus& bus, FrameReader& reader) {
  const auto deadline = Clock::now() + kPatience;
  while (Clock::now() < deadline) {
    if (const auto view = reader.take()) return view;
    bus.wait(seconds(1));
  }
  return std::nullopt;
}

bool isWhole(const FrameView& view) {
  const auto value = static_cast<std::uint8_t>(view.header.sequence + 1);
  return std::all_of(view.data, view.data + view.header.bytes(), [&](auto v) { return v == value; });
}

constexpr std::size_t kFrameBytes = 640 * 480 * 3;  // frames of peer.cpp

TEST(DdsFrames, DetectsFrameOverwrittenWhileHeld) {
  const auto a = makeDdsBus(onOwnDomain(RunMode::kLive)), b = makeDdsBus(onOwnDomain(RunMode::kLive));
  const auto writer = a->frameWriter("cam", kFrameBytes);
  const auto reader = b->frameReader("cam", kFrameBytes);
  ASSERT_TRUE(writer->waitForReaders(1, kPatience));
  ASSERT_TRUE(reader->waitForWriters(1, kPatience));
  FrameHeader header;
  header.width_px = 640;
  header.height_px = 480;
  const auto send = [&](std::uint32_t sequence) {
    header.sequence = sequence;
    std::uint8_t* pixels = writer->begin(header);
    ASSERT_NE(pixels, nullptr);
    std::fill_n(pixels, header.bytes(), static_cast<std::uint8_t>(sequence + 1));
    ASSERT_TRUE(writer->publish());
  };
  send(0);
  const auto view = next(*b, *reader);
  ASSERT_TRUE(view);
  EXPECT_TRUE(isWhole(*view));
  EXPECT_TRUE(reader->stillValid());
  for (std::uint32_t k = 1; k <= 12; ++k) {  // more than the 4 + 2 slots, at a camera's pace
    send(k);
    ASSERT_TRUE(b->wait(kPatience));
  }
  EXPECT_FALSE(isWhole(*view)) << "the frame must be overwritten for this test to be meaningful";
  EXPECT_FALSE(reader->stillValid());
  EXPECT_FALSE(reader->stillValid());
  reader->release();
  EXPECT_EQ(reader->counters().torn, 1u);
}

TEST(DdsProcesses, HeldFrameStaysReadableAfterCameraIsKilled) {
  const auto bus = makeDdsBus(onOwnDomain());
  const auto reader = bus->frameReader("cam", kFrameBytes);
  Peer camera({"camera", std::to_string(ownDomain()), "3"});
  const auto view = next(*bus, *reader);
  ASSERT_TRUE(view);
  // Lets the camera finish sending. A kill while one of its threads holds the reader's notification lock
  // would also end the reader: Boost aborts in a thread of DDS, and the supervisor handles that.
  ASSERT_EQ(camera.line(), "sent");
  const auto deadline = Clock::now() + kPatience;
  for (int in_a_row = 0; in_a_row < 3; in_a_row = camera.isIdle() ? in_a_row + 1 : 0) {
    ASSERT_LT(Clock::now(), deadline) << "the camera never rests";
    std::this_thread::sleep_for(milliseconds(10));
  }
  camera.end(SIGKILL);
  while (reader->matched() > 0) ASSERT_TRUE(bus->wait(kPatience));  // the lease of 3 s
  EXPECT_TRUE(isWhole(*view));
  EXPECT_TRUE(reader->stillValid()) << "no writer is left that could overwrite it";
  reader->release();
  while (const auto rest = reader->take()) reader->release();

  // The same reader receives the frames of a restarted camera.
  Peer successor({"camera", std::to_string(ownDomain()), "3"});
  const auto again = next(*bus, *reader);
  ASSERT_TRUE(again);
  EXPECT_EQ(again->header.sequence, 0u);
  EXPECT_TRUE(isWhole(*again));
  reader->release();
}

TEST(DdsProcesses, HeldFrameStaysReadableAfterCameraEnds) {
  const auto bus = makeDdsBus(onOwnDomain());
  const auto reader = bus->frameReader("cam", kFrameBytes);
  Peer camera({"camera", std::to_string(ownDomain()), "1"});
  const auto view = next(*bus, *reader);
  ASSERT_TRUE(view);
  EXPECT_EQ(camera.end(SIGTERM), 0);
  while (reader->matched() > 0) ASSERT_TRUE(bus->wait(kPatience));
  EXPECT_TRUE(isWhole(*view));
  EXPECT_TRUE(reader->stillValid());
  reader->release();
}

}  // namespace
}  // namespace omnifleet::bus
