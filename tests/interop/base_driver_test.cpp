// The example driver of the guide (docs/examples/base_driver.c, Cyclone DDS in C) beside the project's own
// bus (Fast DDS): commands arrive at the base, wheel speeds arrive at the local mapper.

#include <gtest/gtest.h>

#include <cmath>

#include "tests/multiprocess/listener.h"
#include "tests/multiprocess/process.h"

namespace omnifleet::test {
namespace {

using namespace std::chrono_literals;

constexpr double kLeft_mps = 0.25, kRight_mps = -0.125;
/// The example changes the speed of a wheel by at most 1 m/s² in steps of 20 ms.
constexpr double kLargestStep_mps = 0.02;

std::int64_t systemNow() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

/// A formation service of one robot: sends a command again and again.
class Commander {
 public:
  Commander(Listener& listener, const std::string& robot, double left_mps, double right_mps)
      : writer_(listener.bus().writer(listener.topics().wheels_command, robot)) {
    command_.robot(robot);
    command_.header().clock(v1::Clock::CLOCK_SYSTEM);
    command_.v_left_mps(left_mps);
    command_.v_right_mps(right_mps);
  }

  void send() {
    command_.header().acquired_ns(systemNow());
    command_.header().sequence_number(command_.header().sequence_number() + 1);
    ASSERT_TRUE(writer_->write(command_)) << writer_->error();
  }

 private:
  std::unique_ptr<bus::Writer<v1::WheelCommand>> writer_;
  v1::WheelCommand command_;
};

class BaseDriver : public testing::Test {
 protected:
  static constexpr int kDomain = 82;

  /// Takes what the local mapper of r1 takes. Returns true once both wheels turn as given, for ten samples.
  bool turnsAs(double left_mps, double right_mps) {
    for (v1::WheelOdometry sample; odometry_->take(sample); samples_.push_back(sample)) {
      const bool equal = sample.v_left_mps() == left_mps && sample.v_right_mps() == right_mps;
      steady_ = equal ? steady_ + 1 : 0;
    }
    return steady_ >= 10;
  }

  Listener listener_{kDomain};
  std::unique_ptr<bus::Reader<v1::WheelOdometry>> odometry_ =
      listener_.bus().reader(listener_.topics().wheels_odometry, "r1");
  std::unique_ptr<bus::Reader<v1::WheelOdometry>> everybody_ =
      listener_.bus().reader(listener_.topics().wheels_odometry);
  std::unique_ptr<bus::Reader<v1::WheelOdometry>> other_ =
      listener_.bus().reader(listener_.topics().wheels_odometry, "r2");
  std::vector<v1::WheelOdometry> samples_;
  int steady_ = 0;
  std::string out_ = freshDir("base_driver");
  Process driver_{{BASE_DRIVER, "r1", std::to_string(kDomain)},
                  out_ + "/driver.txt",
                  {{"CYCLONEDDS_URI",
                    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name=\"lo\" "
                    "multicast=\"true\"/></Interfaces>"
                    "</General></Domain></CycloneDDS>"}}};
};

TEST_F(BaseDriver, FollowsCommandsOfItsRobotAndReportsItsWheels) {
  const std::int64_t begin_ns = systemNow();
  ASSERT_TRUE(listener_.until([&] { return turnsAs(0.0, 0.0); }, 20s)) << driver_.output();

  // Commands of another robot pass by: with them the right wheel would turn forward.
  Commander own(listener_, "r1", kLeft_mps, kRight_mps), other(listener_, "r2", 0.5, 0.5);
  steady_ = 0;
  ASSERT_TRUE(listener_.until(
      [&] {
        other.send();
        own.send();
        return turnsAs(kLeft_mps, kRight_mps);
      },
      20s))
      << driver_.output();
  // Without commands the base stands.
  steady_ = 0;
  ASSERT_TRUE(listener_.until([&] { return turnsAs(0.0, 0.0); }, 20s)) << driver_.output();
  const std::int64_t end_ns = systemNow();

  ASSERT_GT(samples_.size(), 50u);
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    const v1::WheelOdometry& s = samples_[i];
    ASSERT_EQ(s.robot(), "r1");
    ASSERT_EQ(s.header().clock(), v1::Clock::CLOCK_SYSTEM);
    // The first speeds are the mean from the start of the program.
    ASSERT_GE(s.header().acquired_ns(), begin_ns - 1'000'000'000);
    ASSERT_LE(s.header().acquired_ns(), end_ns);
    ASSERT_LE(s.header().acquired_ns(), s.header().published_ns());
    ASSERT_GE(s.v_left_mps(), 0.0);
    ASSERT_LE(s.v_left_mps(), kLeft_mps);
    ASSERT_LE(s.v_right_mps(), 0.0);
    ASSERT_GE(s.v_right_mps(), kRight_mps);
    if (i == 0) continue;
    const v1::WheelOdometry& before = samples_[i - 1];
    const auto steps = s.header().sequence_number() - before.header().sequence_number();
    ASSERT_GE(steps, 1u);
    ASSERT_LT(steps, 1000u);
    ASSERT_GT(s.header().acquired_ns(), before.header().acquired_ns());
    ASSERT_LE(std::abs(s.v_left_mps() - before.v_left_mps()), steps * kLargestStep_mps + 1e-9);
  }
  // 50 Hz: the ticks are absolute times, so only the first and the last one may be late on a busy machine.
  const v1::Header &first = samples_.front().header(), &last = samples_.back().header();
  const double period_s = static_cast<double>(last.acquired_ns() - first.acquired_ns()) * 1e-9 /
                          (last.sequence_number() - first.sequence_number());
  EXPECT_NEAR(period_s, 0.020, 0.005);

  v1::WheelOdometry sample;
  EXPECT_TRUE(everybody_->take(sample)) << "the default partition receives nothing";
  EXPECT_FALSE(other_->take(sample)) << "robot r2 receives the wheels of r1";
  driver_.signal(SIGTERM);
  EXPECT_EQ(driver_.wait(5s), std::optional<int>(0)) << driver_.output();
}

}  // namespace
}  // namespace omnifleet::test
