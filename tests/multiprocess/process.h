#pragma once

#include <sys/types.h>

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace omnifleet::test {

/// A child process of a test: its own process group, output into a file; killed by the destructor.
class Process {
 public:
  Process(const std::vector<std::string>& argv, const std::string& log_path,
          const std::map<std::string, std::string>& environment = {});
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  pid_t pid() const { return pid_; }
  void signal(int number) const;
  /// Exit code (128 + signal when killed), or nothing on timeout. Waits for the event (pidfd), does not poll.
  std::optional<int> wait(std::chrono::milliseconds timeout);
  std::string output() const;

 private:
  pid_t pid_ = -1;
  int pid_fd_ = -1;
  std::string log_path_;
  std::optional<int> exit_code_;
};

std::string sourceDir();                        ///< of the project
std::string program(const std::string& name);   ///< bin/omnifleet_<name>
std::string testProgram(const std::string& name);  ///< beside this test
std::string freshDir(const std::string& name);  ///< empty folder below the build's test output
std::vector<std::string> sharedMemoryFiles();   ///< DDS files in /dev/shm
bool alive(pid_t pid);
std::string fileText(const std::string& path);  ///< empty when it is not there
std::string testDataDir();                      ///< other people's data; empty when not on this machine

/// The kernel's name of a program has 15 characters; 0 where there is no such child.
pid_t childNamed(pid_t parent, const std::string& name);

}  // namespace omnifleet::test
