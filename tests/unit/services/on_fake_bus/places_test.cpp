// Topic place at the replica that saves the map: what arrives, what is refused, and what a restarted process
// receives again.

#include "global_merger/places.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/null_sink.h>

#include <functional>
#include <limits>

#include "appearance/map_files.h"
#include "bus/fake_bus.h"
#include "tests/test_data.h"
#include "tests/unit/services/global_merger/place_samples.h"

namespace omnifleet {
namespace {

using test::somePlace;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr auto kPlaceClock = adapters::RunClock::kDataset;

/// Places of one process of the merger. The fleet is r1 and r2.
struct PlaceReader {
  PlaceReader(const std::shared_ptr<bus::FakeNetwork>& network, bus::RunMode mode, bool reads = true)
      : bus(bus::makeFakeBus(network)),
        context{*bus, optionsOf(mode), bus::Topics(mode),
                std::make_shared<spdlog::logger>("test", std::make_shared<spdlog::sinks::null_sink_st>())},
        ends(context),
        places(context, fleet::Fleet::load(context.options.fleet, "", {}), reads, ends) {}

  static bus::ServiceOptions optionsOf(bus::RunMode mode) {
    bus::ServiceOptions options;
    options.fleet = std::string(std::getenv("OMNIFLEET_SOURCE_DIR")) + "/config/fleets/small.yaml";
    options.mode = mode;
    return options;
  }
  bool pull() {
    ends.poll();
    return places.pull(status);
  }
  std::uint64_t drops() { return status.snapshot(bus::StatusBoard::Clock::now()).drops; }
  std::map<std::string, std::string> saved() {
    const test::TempFolder out;
    EXPECT_THAT(places.files().save(out.path()), IsEmpty());
    return test::filesBelow(out.path());
  }
  /// Image numbers of the places of a robot that are in the common map.
  std::vector<std::uint32_t> images(const std::string& robot) {
    const test::TempFolder out;
    EXPECT_THAT(places.files().save(out.path()), IsEmpty());
    return test::readG2o(out / ("places/" + robot + ".g2o")).ids();
  }

  std::unique_ptr<bus::Bus> bus;
  bus::ServiceContext context;
  services::RunEnds ends;
  bus::StatusBoard status;
  services::Places places;
};

/// The test is the localizer.
class PlacesOnBus : public ::testing::Test {
 protected:
  void connect(bus::RunMode mode) {
    bus_ = bus::makeFakeBus(network_);
    const bus::Topics topics(mode);
    for (const char* robot : {"r1", "r2", "r9"}) writers_[robot] = bus_->writer(topics.place, robot);
    ends_ = bus_->writer(topics.run_end);
  }
  void SetUp() override { connect(bus::RunMode::kReplay); }

  static v1::Place wireOf(const Place& place) {
    v1::Place wire;
    adapters::toWire(place, kPlaceClock, wire);
    return wire;
  }
  void write(const Place& place) { write(place.robot, wireOf(place)); }
  void write(const std::string& robot, const v1::Place& wire) {
    ASSERT_TRUE(writers_.at(robot)->write(wire));
  }
  void end(const std::string& robot, std::uint64_t samples) {
    v1::RunEnd end;
    end.stream("place " + robot);
    adapters::fillHeader(1, 0, kPlaceClock, end.header());
    end.samples(samples);
    ASSERT_TRUE(ends_->write(end));
  }

  std::shared_ptr<bus::FakeNetwork> network_ = bus::makeFakeNetwork();
  std::unique_ptr<bus::Bus> bus_;
  std::map<std::string, std::unique_ptr<bus::Writer<v1::Place>>> writers_;
  std::unique_ptr<bus::Writer<v1::RunEnd>> ends_;
};

TEST_F(PlacesOnBus, AreThoseOfAllRobots) {
  PlaceReader reader(network_, bus::RunMode::kReplay);
  EXPECT_FALSE(reader.pull());
  for (std::uint32_t i = 0; i < 3; ++i) write(somePlace("r1", i));
  write(somePlace("r2", 0, "r2"));
  EXPECT_TRUE(reader.pull());
  EXPECT_FALSE(reader.pull());
  EXPECT_THAT(reader.images("r1"), ElementsAre(7u, 17u, 27u));
  EXPECT_EQ(reader.saved().count("maps/r2/places/r2.g2o"), 1u);
  EXPECT_EQ(reader.drops(), 0u);
}

TEST_F(PlacesOnBus, AreNotReadByOtherReplicas) {
  PlaceReader reader(network_, bus::RunMode::kReplay, false);
  write(somePlace("r1", 0));
  EXPECT_FALSE(reader.pull());
  EXPECT_THAT(reader.saved(), IsEmpty());
  EXPECT_TRUE(reader.places.complete());
}

TEST_F(PlacesOnBus, AreRefusedWhenMalformed) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  const std::vector<std::function<void(v1::Place&)>> damages{
      [](v1::Place& w) { w.signature().pop_back(); },
      [](v1::Place& w) { w.signature().push_back(1); },
      [](v1::Place& w) { w.signature().clear(); },
      [](v1::Place& w) { w.scale().pop_back(); },
      [](v1::Place& w) { w.scale()[0] = -1.0f; },
      [](v1::Place& w) { w.scale()[1] = std::numeric_limits<float>::infinity(); },
      [](v1::Place& w) { w.format().stored_rows(3); },
      [](v1::Place& w) { w.format().stored_phases(0); },
      [](v1::Place& w) { w.format().least_elevation_rad(std::numeric_limits<float>::quiet_NaN()); },
      [](v1::Place& w) { w.frame_from_base().x(kNaN); },
      [](v1::Place& w) { w.covariance()[4] = kNaN; },
      [](v1::Place& w) { w.links()[0].this_from_other().theta(kNaN); },
      [](v1::Place& w) { w.links()[0].covariance()[0] = kNaN; },
  };
  for (std::size_t i = 0; i < damages.size(); ++i) {
    network_ = bus::makeFakeNetwork();
    connect(bus::RunMode::kReplay);
    PlaceReader reader(network_, bus::RunMode::kReplay);
    write(somePlace("r1", 0));
    v1::Place damaged = wireOf(somePlace("r1", 1));
    damages[i](damaged);
    write("r1", damaged);
    write(somePlace("r1", 2));
    write(somePlace("r2", 0));
    EXPECT_TRUE(reader.pull());
    EXPECT_EQ(reader.drops(), 1u) << "damage " << i;
    const std::vector<Message> messages = reader.status.takeMessages();
    ASSERT_THAT(messages, SizeIs(1)) << "damage " << i;
    EXPECT_EQ(messages[0].code, ErrorCode::kSampleRejected);
    EXPECT_THAT(messages[0].text, HasSubstr("place r1"));
    EXPECT_THAT(reader.images("r1"), ElementsAre(7u, 27u)) << "damage " << i;
    EXPECT_THAT(reader.images("r2"), ElementsAre(7u)) << "damage " << i;
  }
}

TEST_F(PlacesOnBus, KeepTheSampleBeforeARefusedRevision) {
  PlaceReader reader(network_, bus::RunMode::kReplay);
  write(somePlace("r1", 0));
  v1::Place damaged = wireOf(somePlace("r1", 0, "", 5.0));
  damaged.signature().pop_back();
  write("r1", damaged);
  reader.pull();
  const test::TempFolder out;
  EXPECT_THAT(reader.places.files().save(out.path()), IsEmpty());
  EXPECT_EQ(test::readG2o(out / "places/r1.g2o").vertices.at(0).second.y(), 0.0);
}

TEST_F(PlacesOnBus, OfUnlistedRobotAreRefused) {
  PlaceReader reader(network_, bus::RunMode::kReplay);
  write(somePlace("r9", 0));
  write(somePlace("r1", 0));
  reader.pull();
  EXPECT_EQ(reader.drops(), 1u);
  EXPECT_THAT(reader.status.takeMessages().at(0).text, HasSubstr("place r9"));
  EXPECT_THAT(reader.images("r9"), IsEmpty());
  EXPECT_THAT(reader.images("r1"), ElementsAre(7u));
}

/// Topics have no common order: the end of a stream may arrive before its last samples.
TEST_F(PlacesOnBus, AreCompleteWhenAllAnnouncedOnesHaveArrived) {
  PlaceReader reader(network_, bus::RunMode::kReplay);
  EXPECT_TRUE(reader.places.complete()) << "an external localizer may publish none";
  write(somePlace("r1", 0));
  end("r1", 3);
  end("r2", 0);
  reader.pull();
  EXPECT_FALSE(reader.places.complete());
  write(somePlace("r2", 0));  // of another stream
  write(somePlace("r1", 1));
  reader.pull();
  EXPECT_FALSE(reader.places.complete());
  v1::Place damaged = wireOf(somePlace("r1", 2));
  damaged.signature().pop_back();
  write("r1", damaged);
  reader.pull();
  EXPECT_TRUE(reader.places.complete()) << "a rejected sample must not delay the save";
}

TEST_F(PlacesOnBus, DoNotDependOnTheOrderOfArrival) {
  PlaceReader by_robot(network_, bus::RunMode::kReplay);
  for (const char* robot : {"r1", "r2"}) {
    for (std::uint32_t i = 0; i < 6; ++i) write(somePlace(robot, i));
  }
  by_robot.pull();
  const auto expected = by_robot.saved();
  ASSERT_THAT(expected, SizeIs(6));

  network_ = bus::makeFakeNetwork();
  connect(bus::RunMode::kReplay);
  PlaceReader backwards(network_, bus::RunMode::kReplay);
  for (std::uint32_t i = 6; i-- > 0;) {
    for (const char* robot : {"r2", "r1"}) {
      write(somePlace(robot, i));
      backwards.pull();
    }
  }
  EXPECT_TRUE(backwards.saved() == expected);
}

/// The journal holds 64 samples per robot.
TEST_F(PlacesOnBus, ReachARestartedProcess) {
  std::map<std::string, std::string> before;
  {
    PlaceReader first(network_, bus::RunMode::kReplay);
    for (std::uint32_t i = 0; i < 60; ++i) write(somePlace("r1", i));
    write(somePlace("r1", 3, "", 0.5));
    first.pull();
    before = first.saved();
    ASSERT_THAT(before, SizeIs(3));
  }
  PlaceReader second(network_, bus::RunMode::kReplay);
  EXPECT_TRUE(second.pull());
  EXPECT_EQ(second.drops(), 0u);
  EXPECT_TRUE(second.saved() == before) << "the revision after the place that it replaces";
}

/// The history of the topic holds the last 64 samples of a robot. The files of a process that began later
/// have fewer places, and can be read.
TEST_F(PlacesOnBus, ReachARestartedProcessInPartWhenLive) {
  connect(bus::RunMode::kLive);
  for (std::uint32_t i = 0; i < 70; ++i) write(somePlace("r1", i));
  write(somePlace("r2", 0));
  PlaceReader second(network_, bus::RunMode::kLive);
  EXPECT_TRUE(second.pull());
  const std::vector<std::uint32_t> images = second.images("r1");
  ASSERT_THAT(images, SizeIs(64));
  EXPECT_EQ(images.front(), test::imageOf(6));
  EXPECT_EQ(images.back(), test::imageOf(69));
  EXPECT_THAT(second.images("r2"), SizeIs(1));
  const test::TempFolder out;
  EXPECT_THAT(second.places.files().save(out.path()), IsEmpty());
  EXPECT_THAT(appearance::loadMap(out / "places/r1.g2o").places, SizeIs(64));
}

}  // namespace
}  // namespace omnifleet
