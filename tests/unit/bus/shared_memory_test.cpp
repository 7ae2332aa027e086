// Files in shared memory: who owns them, when they are removed, how much of the memory others will use.

#include "bus/shared_memory.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/file.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <thread>

#include "bus/shared_memory_files.h"
#include "tests/unit/bus/any_bus.h"
#include "tests/unit/bus/in_namespace.h"
#include "tests/unit/bus/peer_process.h"

namespace omnifleet::bus {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::ElementsAreArray;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::IsSupersetOf;
using testing::Not;
using testing::SizeIs;
using Clock = std::chrono::steady_clock;

constexpr std::size_t kMiB = 1u << 20;
constexpr const char* kShm = "/dev/shm";

/// The data-sharing files of one process. Fast DDS writes the low two bytes of the process number into the
/// GUID.
std::vector<std::string> filesOf(pid_t pid) {
  char number[8];
  std::snprintf(number, sizeof number, ".%02x.%02x.", pid & 255, (pid >> 8) & 255);
  std::vector<std::string> names;
  for (const std::string& name : namesIn(kShm)) {
    if (prefixIn(name).find(number, 11) == 11) names.push_back(name);
  }
  return names;
}

Peer& startCamera(Peer& peer, const std::vector<std::string>& wrapper = {}) {
  peer.start({"camera", std::to_string(ownDomain()), "0"}, wrapper);
  peer.line();
  return peer;
}

TEST(SharedMemoryFiles, AreRemovedOnlyForKilledCamera) {
  Peer living, killed;
  const std::vector<std::string> of_living = filesOf(startCamera(living).pid());
  const std::vector<std::string> of_killed = filesOf(startCamera(killed).pid());
  ASSERT_THAT(of_living, SizeIs(1)) << "one frame writer";
  ASSERT_THAT(of_killed, SizeIs(1));
  const pid_t pid_of_living = living.pid();
  killed.end(SIGKILL);
  EXPECT_THAT(removeStaleSharedMemory(), AllOf(IsSupersetOf(of_killed), Not(Contains(of_living.front()))));
  EXPECT_EQ(filesOf(pid_of_living), of_living);
  EXPECT_EQ(living.end(SIGTERM), 0);
  EXPECT_THAT(filesOf(pid_of_living), IsEmpty()) << "a regular end removes the files";
  EXPECT_FALSE(fs::exists(fs::path(kShm) / (kOwnerFile + prefixIn(of_living.front()))));
}

/// A container with `--ipc=host`: it shares /dev/shm but sees no process of this namespace in /proc.
TEST(SharedMemoryFiles, StayWhenContainerCleansWhileCameraRuns) {
  Peer camera;
  const std::vector<std::string> files = filesOf(startCamera(camera).pid());
  ASSERT_THAT(files, SizeIs(1));
  const auto removed = inNamespace(CLONE_NEWPID, "", [] {
    std::string names = std::to_string(::getpid()) + ":";  // the first process of its namespace
    for (const std::string& name : removeStaleSharedMemory()) names += name + "\n";
    return names;
  });
  if (!removed) GTEST_SKIP() << "namespaces of process numbers are not permitted here";
  EXPECT_THAT(*removed, AllOf(testing::StartsWith("1:"), Not(HasSubstr(files.front()))));
  EXPECT_EQ(filesOf(camera.pid()), files);
  EXPECT_EQ(camera.end(SIGTERM), 0);
}

TEST(SharedMemoryFiles, OfCameraInContainerStayUntilItsDeath) {
  if (!inNamespace(CLONE_NEWPID, "", [] { return std::string(); }))
    GTEST_SKIP() << "namespaces of process numbers are not permitted here";
  const auto before = filesOf(1);  // in its own namespace the camera is process 1
  Peer camera;
  startCamera(camera, {"unshare", "--pid", "--fork", "--kill-child", "--mount-proc"});
  std::vector<std::string> files = filesOf(1);
  for (const std::string& name : before)
    files.erase(std::remove(files.begin(), files.end(), name), files.end());
  ASSERT_THAT(files, SizeIs(1));
  EXPECT_THAT(removeStaleSharedMemory(), Not(Contains(files.front())));
  EXPECT_TRUE(fs::exists(fs::path(kShm) / files.front()));
  camera.end(SIGKILL);
  const auto deadline = Clock::now() + kPatience;  // the kernel ends the namespace after its unshare(1)
  bool gone = false;
  while (!gone && Clock::now() < deadline) {
    const auto removed = removeStaleSharedMemory();
    gone = std::count(removed.begin(), removed.end(), files.front()) > 0;
  }
  EXPECT_TRUE(gone);
}

/// A folder in place of /dev/shm.
class SharedMemoryFolder : public testing::Test {
 protected:
  SharedMemoryFolder() { fs::create_directories(folder); }
  ~SharedMemoryFolder() override { fs::remove_all(folder); }
  /// Creates files older than the 2 s within which a lock file may still be unlocked.
  void make(const std::vector<std::string>& names) const {
    for (const std::string& name : names) {
      std::ofstream(folder + "/" + name) << "x";
      fs::last_write_time(folder + "/" + name, fs::file_time_type::clock::now() - std::chrono::minutes(1));
    }
  }
  int locked(const std::string& name, int kind) const {
    const int file = ::open((folder + "/" + name).c_str(), O_RDWR | O_CLOEXEC);
    EXPECT_EQ(::flock(file, kind | LOCK_NB), 0);
    return file;
  }
  std::string folder = (fs::path(testing::TempDir()) / ("shm" + std::to_string(::getpid()))).string();
};

TEST_F(SharedMemoryFolder, TransportFilesStayUnlessTheirLocksAreFree) {
  const std::vector<std::string> dead{"fastrtps_port7411", "fastrtps_port7411_sl", "fastrtps_0f",
                                      "fastrtps_0f_el", "sem.fastrtps_port7411_mutex"};
  const std::vector<std::string> others{"fastrtps_12",
                                        "fastrtps_12_el",
                                        "fastrtps_port7412",
                                        "fastrtps_port7412_sl",
                                        "sem.fastrtps_port7412_mutex",
                                        "fastrtps_without_lock",
                                        "other",
                                        "other_el"};
  make(dead);
  make(others);
  std::ofstream(folder + "/fastrtps_young");
  std::ofstream(folder + "/fastrtps_young_el");
  const int exclusive = locked("fastrtps_12_el", LOCK_EX);     // as the owner of a segment
  const int shared = locked("fastrtps_port7412_sl", LOCK_SH);  // as a listener of a port
  EXPECT_THAT(removeStaleSharedMemory(folder), testing::UnorderedElementsAreArray(dead));
  for (const std::string& name : others) EXPECT_TRUE(fs::exists(folder + "/" + name)) << name;
  EXPECT_TRUE(fs::exists(folder + "/fastrtps_young"));
  ::close(exclusive);
  ::close(shared);
  EXPECT_THAT(removeStaleSharedMemory(folder),
              ElementsAre("fastrtps_12", "fastrtps_12_el", "fastrtps_port7412", "fastrtps_port7412_sl",
                          "sem.fastrtps_port7412_mutex"));
}

TEST_F(SharedMemoryFolder, FilesOfUnknownOwnerStayAndAreCounted) {
  const std::string name = "fast_datasharing_01.0f.78.fd.51.1a.90.de.00.00.00.00_0.0.1.3";
  make({name});
  fs::resize_file(folder + "/" + name, 3 * kMiB);
  EXPECT_THAT(removeStaleSharedMemory(folder), IsEmpty());
  EXPECT_TRUE(fs::exists(folder + "/" + name));
  const SharedMemoryUse use = sharedMemoryUse(folder);
  EXPECT_EQ(use.unknown_files, 1U);
  EXPECT_EQ(use.unknown_bytes, 3 * kMiB);
  EXPECT_GT(use.untouched_bytes, 2 * kMiB);
  EXPECT_THAT([&] { requireSharedMemory(std::size_t{1} << 60, folder); },
              testing::ThrowsMessage<std::runtime_error>(HasSubstr("3 MiB by 1 DDS file of unknown owner")));
}

TEST_F(SharedMemoryFolder, LockedFileIsRemovedAtItsEnd) {
  const std::string path = folder + "/mark";
  {
    const LockedFile file(path, "text\n");
    EXPECT_EQ(firstLine(path), "text");
    EXPECT_FALSE(isUnlocked(path));
  }
  EXPECT_FALSE(fs::exists(path));
  EXPECT_FALSE(isUnlocked(path)) << "a missing file proves nothing";
  EXPECT_THAT(namesIn(folder), IsEmpty());
}

TEST(SharedMemory, RejectsTooLittleFreeSharedMemory) {
  EXPECT_NO_THROW(requireSharedMemory(1));
  EXPECT_THAT([] { requireSharedMemory(std::size_t{1} << 60); },
              testing::ThrowsMessage<std::runtime_error>(
                  HasSubstr("MiB free, but the frames of the cameras need 1099511627777 MiB")));
  // 8 + 2 slots of 12 MiB.
  EXPECT_GE(frameChannelBytes(5000000, RunMode::kReplay), std::size_t{120} << 20);
  EXPECT_LT(frameChannelBytes(5000000, RunMode::kReplay), std::size_t{121} << 20);
}

constexpr const char* kNoMounts = "private mounts are not permitted here";

TEST(SmallSharedMemory, SecondFleetIsRefusedWhileFirstOneStarts) {
  const auto text = inNamespace(0, "size=64m", [] {
    SharedMemoryReservation first(40 * kMiB, "/runs/first");
    std::string refusal;
    try {
      const SharedMemoryReservation second(40 * kMiB, "/runs/second");
    } catch (const std::runtime_error& error) {
      refusal = error.what();
    }
    const SharedMemoryReservation small(20 * kMiB, "/runs/small");
    return refusal;
  });
  if (!text) GTEST_SKIP() << kNoMounts;
  EXPECT_THAT(*text, AllOf(HasSubstr("has 23 MiB free"), HasSubstr("need 41 MiB"),
                           HasSubstr("40 MiB by the fleet with --out /runs/first"), HasSubstr("size=1G")));
}

TEST(SmallSharedMemory, ReservationEndsWithItsProcess) {
  const auto text = inNamespace(0, "size=64m", [] {
    const pid_t child = ::fork();
    if (child == 0) {
      const SharedMemoryReservation first(40 * kMiB, "/runs/first");
      ::kill(::getpid(), SIGKILL);
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    const std::size_t left = namesIn(kShm).size();
    const SharedMemoryReservation second(60 * kMiB, "/runs/second");
    removeStaleSharedMemory();
    return std::to_string(left) + " then " + std::to_string(namesIn(kShm).size());
  });
  if (!text) GTEST_SKIP() << kNoMounts;
  EXPECT_EQ(*text, "1 then 1") << "the file of the killed process is replaced by the one of the second";
}

/// The files of Fast DDS take their pages only when frames are written.
TEST(SmallSharedMemory, CountsPagesThatCameraHasNotYetWritten) {
  const auto text = inNamespace(0, "size=64m", [] {
    SharedMemoryReservation fleet(20 * kMiB, "/runs/first");
    DdsBusOptions options;
    options.domain = ownDomain();
    options.mode = RunMode::kLockstep;
    const auto bus = makeDdsBus(options);
    const SharedMemoryOwner owner(options.domain, "/runs/first");
    const auto writer = bus->frameWriter("cam", 640 * 480 * 3);
    const SharedMemoryUse before = sharedMemoryUse();
    owner.allocate();
    const SharedMemoryUse after = sharedMemoryUse();
    const auto mib = [](std::size_t bytes) { return std::to_string(bytes / kMiB) + " "; };
    return mib(before.free_bytes) + mib(before.untouched_bytes) + mib(before.pending_bytes) +
           mib(before.available()) + "/ " + mib(after.free_bytes) + mib(after.untouched_bytes) +
           mib(after.available()) + "/ " + std::to_string(after.unknown_files);
  });
  if (!text) GTEST_SKIP() << kNoMounts;
  // One channel of 12.5 MiB of 20 MiB promised.
  EXPECT_EQ(*text, "63 12 7 43 / 51 0 43 / 0");
}

TEST(SmallSharedMemory, AllocationFailsInsteadOfBusErrorWhenFull) {
  const auto text = inNamespace(0, "size=24m", [] {
    DdsBusOptions options;
    options.domain = ownDomain();
    options.mode = RunMode::kLockstep;
    const auto bus = makeDdsBus(options);
    const SharedMemoryOwner owner(options.domain, "");
    const auto writer = bus->frameWriter("cam", 640 * 480 * 3);
    std::ofstream("/dev/shm/other") << std::string(16 * kMiB, 'x');
    owner.allocate();
    return std::string("allocated");
  });
  if (!text) GTEST_SKIP() << kNoMounts;
  EXPECT_THAT(*text,
              AllOf(HasSubstr("exception: /dev/shm has 0 MiB free"), HasSubstr("16 MiB by other files")));
}

}  // namespace
}  // namespace omnifleet::bus
