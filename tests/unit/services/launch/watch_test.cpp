#include "launch/watch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "bus/fake_bus.h"

namespace omnifleet::launch {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class WatchTest : public testing::Test {
 protected:
  /// All changes in this time, checked as often as the launcher does.
  std::vector<std::string> after(milliseconds time) {
    std::vector<std::string> changes;
    for (const auto end = now_ + time; now_ < end;) {
      now_ += milliseconds(100);
      for (const std::string& change : watch_->check(now_)) changes.push_back(change);
    }
    return changes;
  }
  void publish(const std::string& name, bool finished = false) { watch_->heard(name, finished, now_); }
  v1::ServiceStatus status() {
    while (reader_->take(status_)) {
    }
    return status_;
  }

  std::shared_ptr<bus::FakeNetwork> network_ = bus::makeFakeNetwork();
  std::unique_ptr<bus::Bus> bus_ = bus::makeFakeBus(network_), observer_ = bus::makeFakeBus(network_);
  bus::Topics topics_{bus::RunMode::kLive};
  std::unique_ptr<bus::Reader<v1::ServiceStatus>> reader_ = observer_->reader(topics_.service_status);
  Watch::Clock::time_point now_{seconds(1000)};
  std::optional<Watch> watch_{
      std::in_place, *bus_, topics_, std::vector<std::string>{"world", "classifier r1"}, "robot1", now_};
  v1::ServiceStatus status_;
};

TEST_F(WatchTest, ReportsSilentServiceOnceAndKeepsItInStatus) {
  publish("classifier r1");
  publish("world");
  EXPECT_THAT(after(seconds(5)), IsEmpty());
  EXPECT_EQ(status().state(), v1::SERVICE_RUNNING);
  EXPECT_EQ(status().service(), "launch");
  EXPECT_EQ(status().instance(), "robot1");
  publish("world");
  EXPECT_THAT(after(seconds(4)), ElementsAre("classifier r1: silent for 5 s"));
  EXPECT_EQ(status().state(), v1::SERVICE_DEGRADED);
  EXPECT_EQ(status().last_error(), "classifier r1 silent for more than 5 s");
  publish("classifier r1");
  EXPECT_THAT(after(milliseconds(100)), ElementsAre("classifier r1: publishes its status again"));
  EXPECT_EQ(status().state(), v1::SERVICE_RUNNING);
  EXPECT_EQ(status().last_error(), "");
}

TEST_F(WatchTest, ReportsStartedServiceThatNeverPublishes) {
  publish("world", true);
  EXPECT_THAT(after(seconds(16)), ElementsAre("classifier r1: not heard in 15 s"));
}

TEST_F(WatchTest, SaysWhatToCheckIfAnotherMachineIsNotHeard) {
  watch_.emplace(*bus_, topics_, std::vector<std::string>{"launch pcB"}, "pcA", now_);
  const std::vector<std::string> changes = after(seconds(16));
  ASSERT_EQ(changes.size(), 1u);
  EXPECT_THAT(changes[0], AllOf(HasSubstr("launch pcB: not heard in 15 s"), HasSubstr("`peers`")));
}

TEST_F(WatchTest, PublishesWhichProcessKeepsFailing) {
  watch_->failing("camera_r1_fisheye failed (exit code 1, 7 times), restart in 5.0 s", now_);
  publish("world", true);
  publish("classifier r1", true);
  after(seconds(1));
  EXPECT_EQ(status().state(), v1::SERVICE_DEGRADED);
  EXPECT_EQ(status().error_code(), "service_failed");
  EXPECT_EQ(status().last_error(), "camera_r1_fisheye failed (exit code 1, 7 times), restart in 5.0 s");
  after(seconds(16));
  EXPECT_EQ(status().state(), v1::SERVICE_RUNNING) << "it has not failed again";
}

TEST_F(WatchTest, IgnoresServicesThatItDidNotStart) {
  publish("world", true);
  publish("classifier r1", true);
  publish("a user's own stage");
  EXPECT_THAT(after(seconds(60)), IsEmpty());
}

TEST_F(WatchTest, PublishesItsEnd) {
  after(seconds(20));
  EXPECT_EQ(status().state(), v1::SERVICE_DEGRADED);
  watch_.reset();
  EXPECT_EQ(status().state(), v1::SERVICE_FINISHED);
  EXPECT_EQ(status().last_error(), "") << "a finished launcher reports no silent service";
}

TEST(SilentText, NamesAsManyServicesAsFit) {
  std::vector<bus::Silence::Silent> silent(30, {"local_mapper r1", seconds(12), true});
  EXPECT_EQ(silentText({silent[0]}), "local_mapper r1 silent for more than 10 s")
      << "does not change every second";
  EXPECT_EQ(silentText({silent[0], silent[1]}),
            "local_mapper r1 silent for more than 10 s, local_mapper r1 silent for more than 10 s");
  const std::string text = silentText(silent);
  EXPECT_LE(text.size(), 512u) << "the limit of ServiceStatus::last_error";
  EXPECT_THAT(text, testing::EndsWith(", 20 more"));
}

}  // namespace
}  // namespace omnifleet::launch
