#pragma once

#include <sys/types.h>

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace omnifleet::test {

/// A child process of a test in its own process group, with its output in a file. The destructor kills it.
class Process {
 public:
  Process(const std::vector<std::string>& argv, const std::string& log_path,
          const std::map<std::string, std::string>& environment = {});
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  pid_t pid() const { return pid_; }
  void signal(int number) const;
  /// Exit code (128 + signal when killed), or empty on timeout. Waits for the event (pidfd) without polling.
  std::optional<int> wait(std::chrono::milliseconds timeout);
  std::string output() const;

 private:
  pid_t pid_ = -1;
  int pid_fd_ = -1;
  std::string log_path_;
  std::optional<int> exit_code_;
};

std::string sourceDir();                           ///< of the project
std::string program(const std::string& name);      ///< bin/omnifleet_<name>
std::string testProgram(const std::string& name);  ///< in the folder of this test
std::string freshDir(const std::string& name);     ///< empty folder below the test output of the build
std::vector<std::string> sharedMemoryFiles();      ///< DDS files in /dev/shm
/// DDS files of frames that this process made, while it runs or after its end. Other fleets may run on the
/// machine.
std::vector<std::string> sharedMemoryFilesOf(pid_t pid);
bool alive(pid_t pid);
std::string fileText(const std::string& path);  ///< empty when the file does not exist
std::string testDataDir();                      ///< external data; empty when not on this machine

/// The first child with this name, or 0. The kernel cuts names of programs to 15 characters.
pid_t childNamed(pid_t parent, const std::string& name);

}  // namespace omnifleet::test
