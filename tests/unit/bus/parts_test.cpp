// Small parts: topic table, type descriptors, IDL hashes, second mappings, wake events.

#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/mman.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <thread>

#include "bus/frame_channel.h"
#include "bus/shared_segments.h"
#include "bus/topics.h"
#include "bus/wake_event.h"

namespace omnifleet::bus {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::StartsWith;

class EveryMode : public testing::TestWithParam<RunMode> {};

TEST_P(EveryMode, TopicsHavePrefixAndKeepAllOnlyInDeterministicModes) {
  const Topics topics(GetParam());
  std::set<std::string> names;
  const auto check = [&](const auto& topic) {
    EXPECT_THAT(topic.name, StartsWith("omnifleet/"));
    EXPECT_TRUE(names.insert(topic.name).second) << topic.name << " is used twice";
    EXPECT_FALSE(topic.qos.data_sharing) << "keyed types do not support data-sharing";
    EXPECT_GE(topic.qos.max_instances, 2) << topic.name;
    EXPECT_LE(topic.qos.depth, topic.qos.max_samples_per_instance)
        << topic.name << ": DDS rejects this as inconsistent";
  };
  const auto stream = [&](const auto& topic) {
    check(topic);
    EXPECT_EQ(topic.qos.keep_all, isDeterministic(GetParam())) << topic.name;
    EXPECT_TRUE(topic.qos.reliable);
  };
  stream(topics.wheels_odometry);
  stream(topics.wheels_command);
  stream(topics.laser);
  stream(topics.local_map);
  stream(topics.objects);
  stream(topics.measurement);
  stream(topics.pose);
  stream(topics.formation_state);
  stream(topics.world_truth);
  const auto kept = [&](const auto& topic, int depth) {
    check(topic);
    EXPECT_TRUE(topic.qos.transient_local) << topic.name;
    EXPECT_EQ(topic.qos.keep_all, depth > 1 && isDeterministic(GetParam())) << topic.name;
    EXPECT_EQ(topic.qos.depth, depth) << topic.name;
  };
  kept(topics.place, 64);
  kept(topics.map_contribution, 64);
  kept(topics.map_keyframe_pose, 64);
  kept(topics.map_octree, 1);
  kept(topics.map_grid, 1);
  kept(topics.map_outlines, 1);
  kept(topics.map_hash, 1);
  kept(topics.formation_command, 1);
  kept(topics.service_status, 1);
  kept(topics.run_end, 1);
  check(topics.map_have);
  check(topics.camera_preview);
  EXPECT_FALSE(topics.camera_preview.qos.reliable);
  EXPECT_EQ(frameQos(GetParam()).depth, GetParam() == RunMode::kLive ? 4 : 8);
}
INSTANTIATE_TEST_SUITE_P(Each, EveryMode,
                         testing::Values(RunMode::kLive, RunMode::kReplay, RunMode::kLockstep),
                         [](const auto& mode) { return std::string(toString(mode.param)); });

TEST(TypeDescriptor, KeyContainsOnlyTheRobot) {
  const TypeDescriptor& type = describe<v1::Pose>();
  EXPECT_EQ(type.name, "omnifleet::v1::Pose");
  v1::Pose a, b;
  a.robot("r1");
  b.robot("r1");
  b.header().acquired_ns(7);
  EXPECT_EQ(type.key(&a), type.key(&b));
  b.robot("r2");
  EXPECT_NE(type.key(&a), type.key(&b));
  const auto copy = type.create();
  type.copy(copy.get(), &b);
  EXPECT_TRUE(*static_cast<const v1::Pose*>(copy.get()) == b);
}

TEST(TypeDescriptor, TypesOfOneFileShareItsHash) {
  EXPECT_EQ(describe<v1::Pose>().idl_hash, describe<v1::Place>().idl_hash) << "both are declared in one file";
  std::set<std::string> hashes = {
      describe<v1::Pose>().idl_hash,          describe<v1::LocalMap>().idl_hash,
      describe<v1::Objects>().idl_hash,       describe<v1::Grid>().idl_hash,
      describe<v1::RunEnd>().idl_hash,        describe<v1::WheelCommand>().idl_hash,
      describe<v1::FormationState>().idl_hash};
  EXPECT_EQ(hashes.size(), 7u);
  for (const auto& hash : hashes) EXPECT_EQ(hash.size(), 64u);
}

/// hashes.h for main.idl in `folder`, written by cmake/IdlHashes.cmake.
std::string hashesOf(const fs::path& folder) {
  const char* source = std::getenv("OMNIFLEET_SOURCE_DIR");
  const std::string script = (fs::path(source == nullptr ? "." : source) / "cmake/IdlHashes.cmake").string();
  const std::string command = "cmake -DIDLS=" + (folder / "main.idl").string() +
                              " -DOUTPUT=" + (folder / "hashes.h").string() + " -P " + script;
  EXPECT_EQ(std::system(command.c_str()), 0);
  std::ifstream file(folder / "hashes.h");
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

TEST(IdlHashes, ChangeWithLayoutOfFileOrIncludesOnly) {
  ASSERT_NE(std::getenv("OMNIFLEET_SOURCE_DIR"), nullptr) << "ctest sets the source folder";
  const fs::path folder = fs::path(testing::TempDir()) / ("idl" + std::to_string(::getpid()));
  fs::create_directories(folder);
  const auto write = [&](const char* name, const char* text) { std::ofstream(folder / name) << text; };
  write("part.idl", "struct Part { long x; };\n");
  write("main.idl", "#include \"part.idl\"\nstruct Main { Part p; };\n");
  const std::string first = hashesOf(folder);
  EXPECT_THAT(first, testing::HasSubstr("kMainHash[]"));
  write("part.idl", "// a comment\nstruct Part {\n  long x;  // metres\n};\n");
  EXPECT_EQ(hashesOf(folder), first);
  write("part.idl", "struct Part { short x; };\n");
  const std::string second = hashesOf(folder);
  EXPECT_NE(second, first);
  write("main.idl", "#include \"part.idl\"\nstruct Main { Part q; };\n");
  EXPECT_NE(hashesOf(folder), second);
  fs::remove_all(folder);
}

TEST(FrameClass, SelectsSmallestThatFits) {
  EXPECT_STREQ(frameClassFor(0).name, "Frame1M");
  EXPECT_STREQ(frameClassFor(1280 * 960).name, "Frame1M");
  EXPECT_STREQ(frameClassFor(1310721).name, "Frame4M");
  EXPECT_STREQ(frameClassFor(1280 * 960 * 3).name, "Frame4M");
  EXPECT_STREQ(frameClassFor(4194305).name, "Frame12M");
  EXPECT_THROW(frameClassFor(12582913), std::runtime_error);
}

TEST(SharedSegments, KeptByteStaysReadableAfterUnmap) {
  const std::string path = testing::TempDir() + "segment" + std::to_string(::getpid());
  constexpr std::size_t kBytes = 3 * 4096;
  std::ofstream(path) << std::string(kBytes, 'a');
  const int file = ::open(path.c_str(), O_RDWR);
  auto* writer =
      static_cast<std::uint8_t*>(::mmap(nullptr, kBytes, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0));
  auto* mapping = static_cast<std::uint8_t*>(::mmap(nullptr, kBytes, PROT_READ, MAP_SHARED, file, 0));
  ::close(file);
  fs::remove(path);
  {
    SharedSegments segments;
    const std::uint8_t* kept = segments.keep(mapping + 5000);
    ASSERT_NE(kept, nullptr);
    EXPECT_NE(kept, mapping + 5000);
    EXPECT_EQ(segments.keep(mapping + 5001), kept + 1);
    EXPECT_EQ(segments.size(), 1u) << "one mapping per segment";
    ::munmap(mapping, kBytes);
    EXPECT_EQ(*kept, 'a');
    writer[5000] = 'b';
    EXPECT_EQ(*kept, 'b') << "the same pages, not a copy";
    segments.clear();
    EXPECT_EQ(segments.size(), 0u);
    EXPECT_EQ(segments.keep(mapping + 5000), nullptr) << "the address is no longer mapped";
  }
  ::munmap(writer, kBytes);
}

TEST(SharedSegments, RejectsPrivateMemory) {
  SharedSegments segments;
  const std::vector<std::uint8_t> own(100);
  EXPECT_EQ(segments.keep(own.data()), nullptr);
}

WakeEvent* signalled = nullptr;

TEST(WakeEvent, SignalHandlerEndsWait) {
#if defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "ThreadSanitizer delays a signal handler that runs just before ppoll until ppoll "
                  "returns, so the handler cannot end the wait";
#endif
  WakeEvent event;
  signalled = &event;
  const auto before = std::signal(SIGUSR1, [](int) { signalled->signal(); });
  std::thread other([waiter = ::pthread_self()] { ::pthread_kill(waiter, SIGUSR1); });
  EXPECT_TRUE(event.wait(seconds(10)));
  other.join();
  std::signal(SIGUSR1, before);
  EXPECT_FALSE(event.wait(milliseconds(0))) << "consumed";
}

TEST(BusSignal, WaitUntilLeavesEventForNextWait) {
  BusSignal signal;
  signal.event.signal();
  EXPECT_TRUE(signal.waitUntil([] { return true; }, seconds(1)));
  EXPECT_TRUE(signal.event.wait(milliseconds(0))) << "the next wait must check for data";
  EXPECT_FALSE(signal.waitUntil([] { return false; }, milliseconds(1)));
  signal.stop = true;
  EXPECT_FALSE(signal.waitUntil([] { return false; }, seconds(1000)));
}

}  // namespace
}  // namespace omnifleet::bus
