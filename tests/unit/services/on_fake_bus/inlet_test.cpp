// Which samples that come too late are a fault.

#include "common/inlet.h"

#include <gmock/gmock.h>

#include "bus/topics.h"
#include "common/newest_term.h"
#include "tests/unit/services/on_fake_bus/stage_bench.h"

namespace omnifleet::services {
namespace {

bus::FakeBusOptions liveBus() {
  bus::FakeBusOptions options;
  options.mode = bus::RunMode::kLive;
  return options;
}

class PoseInlet : public testing::Test {
 protected:
  PoseInlet()
      : network_(bus::makeFakeNetwork()),
        sender_(bus::makeFakeBus(network_, liveBus())),
        receiver_(bus::makeFakeBus(network_, liveBus())),
        writer_(sender_->writer(topics_.pose)),
        ends_({*receiver_, options_, topics_,
               std::make_shared<spdlog::logger>("test", std::make_shared<spdlog::sinks::null_sink_st>())}),
        inlet_(receiver_->reader(topics_.pose), merger_, ends_,
               {"pose r1", "r1", 0, bus::StreamRole::kInput, bus::StreamMode::kLive, true}) {}

  /// Messages that a sample of this time causes.
  std::vector<Message> messagesAt(TimeNs time_ns) {
    v1::Pose pose;
    pose.robot("r1");
    pose.header().acquired_ns(time_ns);
    EXPECT_TRUE(writer_->write(pose));
    inlet_.pull(status_, [](const v1::Pose&, int& payload) {
      payload = 0;
      return true;
    });
    bus::TimeMerger<int>::Batch batch;
    while (merger_.nextBatch(batch)) {
    }
    return status_.takeMessages();
  }

  bool isFault(TimeNs time_ns) {
    status_.clearError();
    messagesAt(time_ns);
    return status_.snapshot(bus::StatusBoard::Clock::now()).last_error.code == ErrorCode::kSampleOutOfOrder;
  }

  bus::ServiceOptions options_;
  bus::Topics topics_{bus::RunMode::kLive};
  std::shared_ptr<bus::FakeNetwork> network_;
  std::unique_ptr<bus::Bus> sender_, receiver_;
  std::unique_ptr<bus::Writer<v1::Pose>> writer_;
  bus::TimeMerger<int> merger_;
  bus::StatusBoard status_;
  RunEnds ends_;
  Inlet<v1::Pose, int> inlet_;
};

/// The localizer that takes over begins with frames that the classifiers have kept.
TEST(NewestTerm, IgnoresTimesThatAnEarlierTermHasPublished) {
  NewestTerm newest;
  EXPECT_TRUE(newest.accepts(1, 1, 100));
  EXPECT_TRUE(newest.accepts(1, 1, 200));
  EXPECT_TRUE(newest.accepts(2, 1, 180));
  EXPECT_FALSE(newest.accepts(1, 2, 190));
  EXPECT_FALSE(newest.accepts(1, 2, 200));
  EXPECT_TRUE(newest.accepts(1, 2, 210));
  EXPECT_TRUE(newest.accepts(2, 2, 190));
  EXPECT_FALSE(newest.accepts(2, 1, 300)) << "the earlier localizer, cut off";
  EXPECT_TRUE(newest.accepts(1, 2, 205)) << "a fault of this term's own order is not hidden";
}

TEST_F(PoseInlet, IgnoresFramesThatRestartedPublisherRepeats) {
  for (const TimeNs time : {10, 20, 30, 40}) EXPECT_THAT(messagesAt(time), testing::IsEmpty());
  for (const TimeNs time : {30, 40, 50}) EXPECT_THAT(messagesAt(time), testing::IsEmpty()) << time;
  EXPECT_EQ(status_.snapshot(bus::StatusBoard::Clock::now()).drops, 2u);
}

TEST_F(PoseInlet, ReportsClockThatIsSetBackOrStandsStill) {
  for (const TimeNs time : {10, 20, 30, 40}) messagesAt(time);
  EXPECT_TRUE(isFault(25)) << "a time that no frame had";
  EXPECT_FALSE(isFault(40)) << "once";
  EXPECT_TRUE(isFault(40));
  EXPECT_FALSE(isFault(50));
}

/// Live, any sample may be lost, also the last one.
TEST_F(PoseInlet, EndsSoonAfterTheEndOfAStreamWhoseLastSampleIsLost) {
  messagesAt(10);
  RunEnds sender({*sender_, options_, topics_, nullptr});
  sender.announce("pose r1", 20, 2);
  const auto announced = std::chrono::steady_clock::now();
  std::vector<Message> messages;
  while (!merger_.finished() && std::chrono::steady_clock::now() - announced < std::chrono::seconds(10)) {
    receiver_->wait(std::chrono::milliseconds(50));
    ends_.poll();
    inlet_.pull(status_, [](const v1::Pose&, int& payload) {
      payload = 0;
      return true;
    });
    for (Message& message : status_.takeMessages()) messages.push_back(std::move(message));
  }
  EXPECT_TRUE(merger_.finished());
  EXPECT_GE(std::chrono::steady_clock::now() - announced, std::chrono::seconds(2)) << "it may be on its way";
  ASSERT_EQ(messages.size(), 1u);
  EXPECT_EQ(messages[0].code, ErrorCode::kStreamSilent);
  EXPECT_THAT(messages[0].text, testing::HasSubstr("pose r1"));
}

}  // namespace
}  // namespace omnifleet::services
