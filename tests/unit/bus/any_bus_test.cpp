#include "tests/unit/bus/any_bus.h"

#include <gmock/gmock.h>

#include <atomic>
#include <map>
#include <numeric>
#include <thread>

namespace omnifleet::bus {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

std::vector<std::int64_t> times(const std::vector<v1::Pose>& poses) {
  std::vector<std::int64_t> result;
  for (const auto& pose : poses) result.push_back(pose.header().acquired_ns());
  return result;
}

/// The bytes of a sample on the wire are those of its type support.
TEST_P(AnyBus, CountsPayloadOfTopicsThatOtherHostsRead) {
  const auto a = network.join(), b = network.join();
  const Topics topics(RunMode::kLockstep);
  const auto poses = a->writer(topics.pose);
  const auto objects = a->writer(topics.objects);
  v1::Pose pose = poseOf("r1", 1);
  ASSERT_TRUE(poses->write(pose));
  EXPECT_EQ(a->traffic().out_bytes, 0U) << "it has no reader";
  const auto reader = b->reader(topics.pose);
  const auto objects_reader = b->reader(topics.objects);
  ASSERT_TRUE(poses->waitForReaders(1, kPatience));
  ASSERT_TRUE(objects->waitForReaders(1, kPatience));
  pose.header().acquired_ns(2);
  ASSERT_TRUE(poses->write(pose));
  v1::Objects seen;
  seen.robot("r1");
  ASSERT_TRUE(objects->write(seen));
  ASSERT_EQ(receive(*b, *objects_reader, 1).size(), 1U);
  const std::size_t size = v1::Pose::getCdrSerializedSize(pose) + 4;
  EXPECT_EQ(a->traffic().out_bytes, size) << "objects stay on the host of the robot";
  ASSERT_EQ(receive(*b, *reader, 2).size(), 2U);
  EXPECT_EQ(b->traffic().in_bytes, 2 * size) << "the late joiner got the first one as well";
  EXPECT_EQ(b->traffic().out_bytes, 0U);
}

TEST_P(AnyBus, DeliversSamplesOfFortyRobotsInOrderPerRobot) {
  const auto a = network.join(), b = network.join();
  const Topics topics(RunMode::kLockstep);
  const auto writer = a->writer(topics.pose);
  const auto reader = b->reader(topics.pose);
  ASSERT_TRUE(writer->waitForReaders(1, kPatience));
  for (int k = 0; k < 5; ++k) {
    for (int r = 0; r < 40; ++r) ASSERT_TRUE(writer->write(poseOf("r" + std::to_string(r), k, r + 0.25 * k)));
  }
  std::map<std::string, std::vector<double>> got;
  for (const auto& pose : receive(*b, *reader, 200))
    got[pose.robot().to_string()].push_back(pose.map_from_base().x());
  ASSERT_EQ(got.size(), 40u);
  for (int r = 0; r < 40; ++r) {
    EXPECT_THAT(got["r" + std::to_string(r)], ElementsAre(r, r + 0.25, r + 0.5, r + 0.75, r + 1.0));
  }
  EXPECT_EQ(reader->counters().received, 200u);
  EXPECT_EQ(reader->counters().lost, 0u);
}

TEST_P(AnyBus, TransfersNestedFieldsUnchanged) {
  const auto a = network.join(), b = network.join();
  const Topics topics(RunMode::kLockstep);
  const auto writer = a->writer(topics.local_map, "r1");
  const auto reader = b->reader(topics.local_map, "r1");
  ASSERT_TRUE(writer->waitForReaders(1, kPatience));
  v1::LocalMap map;
  map.robot("r1");
  map.header().acquired_ns(-5000000000123456789);
  map.state(v1::FRAME_TORN);
  map.scan().range_m({1.5f, 2.5f});
  map.scan().label({1, 255});
  v1::ObjectObservation object;
  object.label(65535);
  object.rect_px({-1, 2, 3, 4});
  object.hull().resize(96);
  object.hull()[95].y(-0.125);
  object.vectors().resize(256);
  object.vectors()[255].residual_m({0.5f, -0.5f});
  map.objects().assign(64, object);
  ASSERT_TRUE(writer->write(map));
  const auto got = receive(*b, *reader, 1);
  ASSERT_EQ(got.size(), 1u);
  EXPECT_TRUE(got[0] == map);
}

TEST_P(AnyBus, ReaderWithRobotReadsItsPartitionOtherReadersReadAll) {
  const auto a = network.join(), b = network.join();
  const Topics topics(RunMode::kLockstep);
  const auto r1 = a->writer(topics.pose, "r1");
  const auto r2 = a->writer(topics.pose, "r2");
  const auto own = b->reader(topics.pose, "r1");
  const auto all = b->reader(topics.pose);
  ASSERT_TRUE(r1->waitForReaders(2, kPatience));
  ASSERT_TRUE(r2->waitForReaders(1, kPatience));
  ASSERT_TRUE(own->waitForWriters(1, kPatience));
  ASSERT_TRUE(all->waitForWriters(2, kPatience));
  ASSERT_TRUE(r2->write(poseOf("r2", 2)));
  ASSERT_TRUE(r1->write(poseOf("r1", 1)));
  EXPECT_EQ(receive(*b, *all, 2).size(), 2u);
  EXPECT_THAT(times(receive(*b, *own, 1)), ElementsAre(1));
  EXPECT_EQ(own->matched(), 1);
  EXPECT_EQ(r2->matched(), 1);
}

TEST_P(AnyBus, RejectsNamesWithWildcards) {
  const auto a = network.join();
  const Topics topics(RunMode::kLive);
  EXPECT_THROW(a->writer(topics.pose, "r*"), std::runtime_error);
  EXPECT_THROW(a->reader(topics.pose, "r?"), std::runtime_error);
}

TEST_P(AnyBus, LateJoinerReceivesLast64SamplesOfEachRobot) {
  const auto a = network.join(), b = network.join();
  const Topics topics(RunMode::kLive);
  const auto writer = a->writer(topics.map_keyframe_pose);
  v1::KeyframePose pose;
  for (int t = 0; t < 100; ++t) {
    for (const char* robot : {"r1", "r2"}) {
      pose.robot(robot);
      pose.header().acquired_ns(t);
      ASSERT_TRUE(writer->write(pose)) << writer->error();
    }
  }
  const auto late = b->reader(topics.map_keyframe_pose);
  std::map<std::string, std::vector<std::int64_t>> got;
  for (const auto& sample : receive(*b, *late, 128))
    got[sample.robot().to_string()].push_back(sample.header().acquired_ns());
  std::vector<std::int64_t> last64(64);
  std::iota(last64.begin(), last64.end(), 36);
  EXPECT_EQ(got["r1"], last64);
  EXPECT_EQ(got["r2"], last64);
}

TEST_P(AnyBus, LateJoinerOfVolatileTopicReceivesNoOldSample) {
  const auto a = network.join(), b = network.join();
  const Topics topics(RunMode::kLive);
  const auto writer = a->writer(topics.pose);
  const auto early = a->reader(topics.pose);
  ASSERT_TRUE(writer->waitForReaders(1, kPatience));
  ASSERT_TRUE(writer->write(poseOf("r1", 1)));
  ASSERT_EQ(receive(*a, *early, 1).size(), 1u);
  const auto late = b->reader(topics.pose);
  ASSERT_TRUE(writer->waitForReaders(2, kPatience));
  ASSERT_TRUE(late->waitForWriters(1, kPatience));
  ASSERT_TRUE(writer->write(poseOf("r1", 2)));
  EXPECT_THAT(times(receive(*b, *late, 1)), ElementsAre(2));
}

TEST_P(AnyBus, DeterministicStreamReachesReaderThatMatchesLater) {
  const auto a = network.join(), b = network.join();
  const Topics topics(RunMode::kReplay);
  const auto writer = a->writer(topics.pose, "r1");
  for (int t = 0; t < 60; ++t) ASSERT_TRUE(writer->write(poseOf("r1", t)));
  const auto reader = b->reader(topics.pose, "r1");
  std::vector<std::int64_t> all(60);
  std::iota(all.begin(), all.end(), 0);
  EXPECT_EQ(times(receive(*b, *reader, 60)), all);
}

/// The corrections at the end of a long run: at once many more samples of one robot than the history holds.
TEST_P(AnyBus, DeterministicJournalLosesNoSampleOfBurst) {
  const auto a = network.join(), b = network.join();
  const Topics topics(RunMode::kReplay);
  const auto writer = a->writer(topics.map_keyframe_pose, "r1");
  const auto reader = b->reader(topics.map_keyframe_pose);
  ASSERT_TRUE(writer->waitForReaders(1, kPatience));
  constexpr int kBurst = 500;
  bool written = true;
  std::thread burst([&] {
    v1::KeyframePose pose;
    pose.robot("r1");
    for (int t = 0; t < kBurst; ++t) {
      pose.header().acquired_ns(t);
      written = writer->write(pose) && written;
    }
  });
  const auto got = receive(*b, *reader, kBurst);
  burst.join();
  EXPECT_TRUE(written) << writer->error();
  ASSERT_EQ(got.size(), static_cast<std::size_t>(kBurst));
  for (int t = 0; t < kBurst; ++t) EXPECT_EQ(got[static_cast<std::size_t>(t)].header().acquired_ns(), t);
}

TEST_P(AnyBus, DeterministicStreamDoesNotBlockWithoutReader) {
  const auto a = network.join();
  const auto writer = a->writer(Topics(RunMode::kReplay).pose, "r1");
  for (int t = 0; t < 200; ++t) ASSERT_TRUE(writer->write(poseOf("r1", t))) << writer->error();
}

TEST_P(AnyBus, KeepLastKeepsNewestPerRobotAndCountsLostSamples) {
  const auto a = network.join(), b = network.join();
  const Topics topics(RunMode::kLive);
  const auto writer = a->writer(topics.pose);
  const auto reader = b->reader(topics.pose);
  ASSERT_TRUE(writer->waitForReaders(1, kPatience));
  ASSERT_TRUE(writer->write(poseOf("r1", -1)));
  ASSERT_EQ(receive(*b, *reader, 1).size(), 1u);  // gaps are counted from the first sample on
  for (int t = 0; t < 50; ++t) ASSERT_TRUE(writer->write(poseOf("r1", t)));
  ASSERT_TRUE(writer->write(poseOf("r2", 7)));
  ASSERT_TRUE(a->flush(kPatience));  // no further sample can arrive
  const auto got = receive(*b, *reader, 17);
  ASSERT_EQ(got.size(), 17u) << "16 of r1 and the one of r2";
  v1::Pose more;
  EXPECT_FALSE(reader->take(more));
  std::vector<std::int64_t> of_r1;
  for (const auto& pose : got) {
    if (pose.robot() == "r1") of_r1.push_back(pose.header().acquired_ns());
  }
  std::vector<std::int64_t> newest(16);
  std::iota(newest.begin(), newest.end(), 34);
  EXPECT_EQ(of_r1, newest);
  EXPECT_EQ(reader->counters().lost, 34u);
}

TEST_P(AnyBus, RejectsKeyBeyondMaxInstancesWithError) {
  const auto a = network.join();
  const Topics topics(RunMode::kLockstep);
  const auto writer = a->writer(topics.pose);
  for (int r = 0; r < topics.pose.qos.max_instances; ++r) {
    ASSERT_TRUE(writer->write(poseOf("r" + std::to_string(r), 0)));
  }
  EXPECT_FALSE(writer->write(poseOf("one more", 0)));
  EXPECT_THAT(writer->error(), HasSubstr("max_instances"));
  EXPECT_TRUE(writer->write(poseOf("r0", 1))) << "known keys are still accepted";
  EXPECT_THAT(writer->error(), IsEmpty());
}

TEST_P(AnyBus, DropsCountsAndReportsSamplesOfAnotherIdl) {
  std::vector<std::string> reports;
  const auto other = network.join({RunMode::kLockstep, "here", "another layout"});
  const auto same = network.join();
  const auto b = network.join({RunMode::kLockstep, "here", "", &reports});
  const Topics topics(RunMode::kLockstep);
  const auto foreign = other->writer(topics.pose);
  const auto known = same->writer(topics.pose);
  const auto reader = b->reader(topics.pose);
  ASSERT_TRUE(foreign->waitForReaders(1, kPatience));
  ASSERT_TRUE(known->waitForReaders(1, kPatience));
  for (int t = 0; t < 3; ++t) ASSERT_TRUE(foreign->write(poseOf("r1", t)));
  ASSERT_TRUE(other->flush(kPatience));
  ASSERT_TRUE(known->write(poseOf("r2", 77)));
  EXPECT_THAT(times(receive(*b, *reader, 1)), ElementsAre(77));
  v1::Pose none;
  EXPECT_FALSE(reader->take(none));  // keys may be taken in any order; all were processed by now
  EXPECT_EQ(reader->counters().rejected, 3u);
  EXPECT_EQ(reader->counters().received, 1u);
  EXPECT_THAT(reports, ElementsAre(HasSubstr("another IDL")));
}

/// A merger of an older version publishes outlines without quality and rejected candidates.
TEST_P(AnyBus, DropsOutlinesOfAnOlderLayout) {
  std::vector<std::string> reports;
  const auto older = network.join({RunMode::kLockstep, "here", "layout of last year"});
  const auto b = network.join({RunMode::kLockstep, "here", "", &reports});
  const Topics topics(RunMode::kLockstep);
  const auto writer = older->writer(topics.map_outlines);
  const auto reader = b->reader(topics.map_outlines);
  ASSERT_TRUE(writer->waitForReaders(1, kPatience));
  v1::Outlines outlines;
  outlines.map_name("map");
  ASSERT_TRUE(writer->write(outlines));
  ASSERT_TRUE(older->flush(kPatience));
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  v1::Outlines none;
  while (reader->counters().rejected == 0 && std::chrono::steady_clock::now() < deadline) {
    b->wait(milliseconds(10));
    EXPECT_FALSE(reader->take(none));
  }
  EXPECT_EQ(reader->counters().rejected, 1u);
  EXPECT_EQ(reader->counters().received, 0u);
  EXPECT_THAT(reports, ElementsAre(HasSubstr("another IDL")));
}

TEST_P(AnyBus, WakeEndsWaitAndIsNotLost) {
  const auto a = network.join();
  a->wait(milliseconds(0));  // removes events of the construction
  a->wake();
  a->wake();
  EXPECT_TRUE(a->wait(kPatience)) << "a wake before the wait counts";
  EXPECT_FALSE(a->wait(milliseconds(1))) << "several count as one";
  std::thread other([&] { a->wake(); });
  EXPECT_TRUE(a->wait(kPatience));
  other.join();
}

TEST_P(AnyBus, StopEndsWaitForReaders) {
  const auto a = network.join();
  const auto writer = a->writer(Topics(RunMode::kLive).pose);
  EXPECT_FALSE(writer->waitForReaders(1, milliseconds(5)));
  std::thread other([&] { a->requestStop(); });
  EXPECT_FALSE(writer->waitForReaders(1, kPatience));
  other.join();
  EXPECT_TRUE(a->stopping());
}

TEST_P(AnyBus, DestroyedReaderIsUnmatched) {
  const auto a = network.join(), b = network.join();
  const Topics topics(RunMode::kLockstep);
  const auto writer = a->writer(topics.pose);
  auto reader = b->reader(topics.pose);
  ASSERT_TRUE(writer->waitForReaders(1, kPatience));
  reader.reset();
  while (writer->matched() > 0) ASSERT_TRUE(a->wait(kPatience));
  EXPECT_TRUE(writer->write(poseOf("r1", 1)));
}

FrameHeader frameHeader(std::uint32_t sequence) {
  FrameHeader header;
  header.acquired_ns = 1234567890123456789 + sequence;
  header.clock = ClockId::kSim;
  header.sequence = sequence;
  header.width_px = 64;
  header.height_px = 48;
  header.channels = 3;
  return header;
}

bool send(FrameWriter& writer, std::uint32_t sequence) {
  const FrameHeader header = frameHeader(sequence);
  std::uint8_t* pixels = writer.begin(header);
  if (pixels == nullptr) return false;
  std::fill_n(pixels, header.bytes(), static_cast<std::uint8_t>(sequence));
  return writer.publish();
}

/// Waits for the next frame.
std::optional<FrameView> next(Bus& bus, FrameReader& reader) {
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  while (std::chrono::steady_clock::now() < deadline) {
    if (const auto view = reader.take()) return view;
    bus.wait(seconds(1));
  }
  return std::nullopt;
}

TEST_P(AnyBus, FramesArriveWithHeaderAndPixels) {
  const auto a = network.join(), b = network.join();
  const auto writer = a->frameWriter("cam", frameHeader(0).bytes());
  const auto reader = b->frameReader("cam", frameHeader(0).bytes());
  ASSERT_TRUE(writer->waitForReaders(1, kPatience));
  ASSERT_TRUE(reader->waitForWriters(1, kPatience));
  for (std::uint32_t k = 0; k < 30; ++k) {  // more than the slots of the history
    ASSERT_TRUE(send(*writer, k)) << writer->error();
    const auto view = next(*b, *reader);
    ASSERT_TRUE(view);
    const FrameHeader expected = frameHeader(k);
    EXPECT_EQ(view->header.acquired_ns, expected.acquired_ns);
    EXPECT_EQ(view->header.clock, expected.clock);
    EXPECT_EQ(view->header.sequence, k);
    EXPECT_EQ(view->header.bytes(), expected.bytes());
    EXPECT_TRUE(std::all_of(view->data, view->data + expected.bytes(), [&](auto v) { return v == k; }));
    EXPECT_TRUE(reader->stillValid());
    EXPECT_TRUE(reader->holding());
    EXPECT_FALSE(reader->take()) << "one loan at a time";
    reader->release();
    EXPECT_FALSE(reader->stillValid()) << "no frame is held";
  }
  EXPECT_EQ(reader->counters().received, 30u);
  EXPECT_EQ(reader->counters().lost + reader->counters().torn, 0u);
}

TEST_P(AnyBus, DeterministicModeLosesNoFrameWithSlowReader) {
  const auto a = network.join(), b = network.join();
  const auto writer = a->frameWriter("cam", frameHeader(0).bytes());
  const auto reader = b->frameReader("cam", frameHeader(0).bytes());
  ASSERT_TRUE(writer->waitForReaders(1, kPatience));
  std::atomic<std::uint32_t> sent{0};
  std::thread camera([&] {
    while (sent < 60) {
      if (send(*writer, sent)) {
        ++sent;
      } else {
        a->wait(milliseconds(100));  // all slots are in use
      }
    }
  });
  for (std::uint32_t k = 0; k < 60; ++k) {
    const auto view = next(*b, *reader);
    ASSERT_TRUE(view);
    EXPECT_EQ(view->header.sequence, k);
    // Holds the frame until the 8 slots of the history are full again, when a reuse of this slot would be
    // due.
    while (sent < std::min(60u, k + 9)) std::this_thread::yield();
    EXPECT_TRUE(std::all_of(view->data, view->data + view->header.bytes(), [&](auto v) { return v == k; }));
    EXPECT_TRUE(reader->stillValid());
    reader->release();
  }
  camera.join();
  EXPECT_EQ(reader->counters().torn + reader->counters().lost, 0u);
}

/// Sends one frame and waits until the reader's bus is notified, at a camera's pace. The thread of a reader
/// that is overtaken within a burst may never return (docs/methods/dds.md).
bool sendPaced(FrameWriter& writer, std::uint32_t sequence, Bus& readers_bus) {
  return send(writer, sequence) && readers_bus.wait(kPatience);
}

TEST_P(AnyBus, LiveModeKeepsNewestFramesAndCountsLostOnes) {
  const auto a = network.join({RunMode::kLive}), b = network.join({RunMode::kLive});
  const auto writer = a->frameWriter("cam", frameHeader(0).bytes());
  const auto reader = b->frameReader("cam", frameHeader(0).bytes());
  ASSERT_TRUE(writer->waitForReaders(1, kPatience));
  ASSERT_TRUE(reader->waitForWriters(1, kPatience));
  constexpr std::uint32_t kFrames = 40, kKept = 4;
  ASSERT_TRUE(send(*writer, 0));
  ASSERT_TRUE(next(*b, *reader));
  reader->release();
  for (std::uint32_t k = 1; k < kFrames; ++k)
    ASSERT_TRUE(sendPaced(*writer, k, *b)) << "live mode must not block";
  for (std::uint32_t k = kFrames - kKept; k < kFrames; ++k) {
    const auto view = next(*b, *reader);
    ASSERT_TRUE(view);
    EXPECT_EQ(view->header.sequence, k);
    EXPECT_TRUE(std::all_of(view->data, view->data + view->header.bytes(), [&](auto v) { return v == k; }));
    reader->release();
  }
  EXPECT_EQ(reader->counters().received, 1u + kKept);
  EXPECT_EQ(reader->counters().lost, kFrames - 1u - kKept);
  EXPECT_EQ(reader->counters().torn, 0u);
}

TEST_P(AnyBus, FramesMatchOnlySameMachineAndFrameClass) {
  const auto a = network.join(), b = network.join(), far = network.join({RunMode::kLockstep, "elsewhere"});
  const auto writer = a->frameWriter("cam", frameHeader(0).bytes());
  const auto away = far->frameReader("cam", frameHeader(0).bytes());
  const auto other_class = b->frameReader("cam", 2000000);
  const auto here = b->frameReader("cam2", frameHeader(0).bytes());
  const auto writer2 = a->frameWriter("cam2", frameHeader(0).bytes());
  ASSERT_TRUE(writer2->waitForReaders(1, kPatience)) << "wrong matches would exist by now";
  EXPECT_EQ(writer->matched(), 0);
  EXPECT_EQ(away->matched(), 0);
}

TEST_P(AnyBus, DeliversInvalidFramesAndRejectsTooLargeOnes) {
  const auto a = network.join(), b = network.join();
  const auto writer = a->frameWriter("cam", frameHeader(0).bytes());
  const auto reader = b->frameReader("cam", frameHeader(0).bytes());
  ASSERT_TRUE(writer->waitForReaders(1, kPatience));
  FrameHeader header = frameHeader(0);
  ASSERT_NE(writer->begin(header), nullptr);
  writer->abandon();
  EXPECT_FALSE(writer->publish());
  ASSERT_NE(writer->begin(header), nullptr);
  header.state = FrameState::kUnreadable;
  header.width_px = header.height_px = 0;
  writer->amend(header);
  ASSERT_TRUE(writer->publish());
  const auto view = next(*b, *reader);
  ASSERT_TRUE(view);
  EXPECT_EQ(view->header.state, FrameState::kUnreadable);
  EXPECT_EQ(view->header.bytes(), 0u);
  header.width_px = 4000;
  header.height_px = 3000;
  EXPECT_EQ(writer->begin(header), nullptr);
  EXPECT_THAT(writer->error(), HasSubstr("is larger than frame class Frame1M"));
  EXPECT_THROW(a->frameWriter("huge", 1u << 30), std::runtime_error);
}

INSTANTIATE_TEST_SUITE_P(On, AnyBus, testing::Values("Fake", "Dds"),
                         [](const auto& kind) { return std::string(kind.param); });

}  // namespace
}  // namespace omnifleet::bus
