#pragma once

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace omnifleet::bus {

/// Runs the program of peer.cpp as another process. The destructor kills it if it still runs.
class Peer {
 public:
  /// Returns when the peer has printed its first line ("ready") or has ended.
  explicit Peer(std::vector<std::string> arguments) {
    start(std::move(arguments));
    line();
  }
  /// Use with start(): does not wait until the peer is ready.
  Peer() = default;
  /// @param wrapper program and arguments that run the peer, e.g. unshare
  void start(std::vector<std::string> arguments, std::vector<std::string> wrapper = {}) {
    arguments.insert(arguments.begin(), OMNIFLEET_BUS_PEER);
    arguments.insert(arguments.begin(), wrapper.begin(), wrapper.end());
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0) throw std::runtime_error("no pipe");
    pid_ = ::fork();
    if (pid_ == 0) run(std::move(arguments), ends[1]);
    ::close(ends[1]);
    output_ = ends[0];
  }
  ~Peer() {
    end(SIGKILL);
    ::close(output_);
  }
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;

  /// The next line of its output; empty at the end.
  std::string line() {
    std::string text;
    char c = 0;
    while (::read(output_, &c, 1) == 1 && c != '\n') text += c;
    return text;
  }
  pid_t pid() const { return pid_; }
  void signal(int number) const { ::kill(pid_, number); }
  /// Whether every thread waits in the kernel, so none can hold a lock in shared memory that is held only for
  /// a few instructions.
  bool isIdle() const {
    for (const auto& thread :
         std::filesystem::directory_iterator("/proc/" + std::to_string(pid_) + "/task")) {
      std::ifstream file(thread.path() / "stat");
      std::string stat;
      std::getline(file, stat);
      const auto name_end = stat.rfind(')');  // "id (name) state …"
      if (name_end == std::string::npos || stat.substr(name_end + 1, 2) != " S") return false;
    }
    return true;
  }
  /// Sends the signal (0: none) and waits for the end. @return exit code, or −signal when it was killed
  int end(int number) {
    if (pid_ <= 0) return code_;
    if (number != 0) ::kill(pid_, number);
    int status = 0;
    ::waitpid(pid_, &status, 0);
    pid_ = 0;
    code_ = WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
    return code_;
  }

 private:
  [[noreturn]] static void run(std::vector<std::string> arguments, int output) {
    ::dup2(output, STDOUT_FILENO);
    std::vector<char*> argv;
    for (auto& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    ::execvp(argv[0], argv.data());
    ::_exit(127);
  }
  pid_t pid_ = 0;
  int output_ = -1;
  int code_ = -1;
};

}  // namespace omnifleet::bus
