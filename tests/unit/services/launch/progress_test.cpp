#include "launch/progress.h"

#include <gtest/gtest.h>

namespace omnifleet::launch {
namespace {

TEST(ProgressLine, ShowsRemainingTimeOfRecording) {
  EXPECT_EQ(progressLine(120, {250, false}, 10.0, false),
            "120/250 frames per robot, 12.0 frames/s, 11 s left");
  EXPECT_EQ(progressLine(120, {250, false}, 0.5, false), "120/250 frames per robot")
      << "no rate in the first second";
  EXPECT_EQ(progressLine(250, {250, false}, 10.0, true), "250/250 frames per robot, 25.0 frames/s");
  EXPECT_EQ(progressLine(17, {25, false}, 10.0, true),
            "17/25 frames per robot (robot with the fewest frames), 1.7 frames/s");
}

TEST(ProgressLine, ShowsUpperBoundForArena) {
  EXPECT_EQ(progressLine(100, {301, true}, 10.0, false),
            "100 frames per robot (at most 301), 10.0 frames/s, at most 20 s left");
  EXPECT_EQ(progressLine(133, {301, true}, 10.0, true), "133 frames per robot (at most 301), 13.3 frames/s")
      << "the run has ended: no remaining time";
}

TEST(ProgressLine, ShowsElapsedTimeOfLiveFleet) {
  EXPECT_EQ(progressLine(50, {}, 10.0, false), "50 frames per robot, 5.0 frames/s, 10 s");
}

/// Otherwise it may stay deaf to a service after the link was cut (docs/methods/dds.md).
TEST(ListenerOptions, LeaseBetweenHostsIsThatOfTheServices) {
  for (const std::vector<std::string>& peers : {std::vector<std::string>{}, {"10.77.0.2"}}) {
    Listening listening;
    listening.network.addresses = {"10.77.0.1"};
    listening.network.peers = peers;
    bus::DdsBusOptions service;
    listening.network.apply(service);
    EXPECT_EQ(listenerOptions(listening).lease, service.lease) << peers.size() << " peers";
  }
}

TEST(ListenerOptions, LeaseWithinOneHostOutlastsABusyMachine) {
  EXPECT_GT(listenerOptions(Listening{}).lease, bus::DdsBusOptions{}.lease);
}

}  // namespace
}  // namespace omnifleet::launch
