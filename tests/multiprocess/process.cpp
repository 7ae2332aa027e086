#include "tests/multiprocess/process.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace omnifleet::test {
namespace fs = std::filesystem;

Process::Process(const std::vector<std::string>& argv, const std::string& log_path,
                 const std::map<std::string, std::string>& environment)
    : log_path_(log_path) {
  std::vector<char*> arguments;
  for (const std::string& argument : argv) arguments.push_back(const_cast<char*>(argument.c_str()));
  arguments.push_back(nullptr);
  const int log = open(log_path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (log < 0) throw std::runtime_error("cannot write " + log_path);
  pid_ = fork();
  if (pid_ == 0) {
    setpgid(0, 0);
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    for (const auto& [key, value] : environment) setenv(key.c_str(), value.c_str(), 1);
    dup2(log, STDOUT_FILENO);
    dup2(log, STDERR_FILENO);
    execv(arguments[0], arguments.data());
    _exit(127);
  }
  close(log);
  if (pid_ < 0) throw std::runtime_error("fork failed");
  pid_fd_ = static_cast<int>(syscall(SYS_pidfd_open, pid_, 0));
}

Process::~Process() {
  if (!exit_code_) {
    kill(-pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  if (pid_fd_ >= 0) close(pid_fd_);
}

void Process::signal(int number) const {
  kill(pid_, number);
}

std::optional<int> Process::wait(std::chrono::milliseconds timeout) {
  if (exit_code_) return exit_code_;
  pollfd waiting{pid_fd_, POLLIN, 0};
  if (poll(&waiting, 1, static_cast<int>(timeout.count())) <= 0) return std::nullopt;
  int status = 0;
  waitpid(pid_, &status, 0);
  exit_code_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return exit_code_;
}

std::string Process::output() const {
  return fileText(log_path_);
}

namespace {
std::string environment(const char* name) {
  const char* value = std::getenv(name);
  return value ? value : "";
}
}  // namespace

std::string sourceDir() {
  return environment("OMNIFLEET_SOURCE_DIR");
}

namespace {
/// Tests are in BUILD/tests, programs in BUILD/bin.
fs::path buildDir() {
  return fs::read_symlink("/proc/self/exe").parent_path().parent_path();
}
}  // namespace

std::string program(const std::string& name) {
  return (buildDir() / "bin" / ("omnifleet_" + name)).string();
}

std::string testProgram(const std::string& name) {
  return (buildDir() / "tests" / name).string();
}

std::string freshDir(const std::string& name) {
  const fs::path folder = buildDir() / "Testing" / "runs" / name;
  fs::remove_all(folder);
  fs::create_directories(folder);
  return folder.string();
}

std::vector<std::string> sharedMemoryFiles() {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator("/dev/shm")) {
    const std::string name = entry.path().filename().string();
    if (name.rfind("fast", 0) == 0 || name.rfind("sem.fast", 0) == 0) names.push_back(name);
  }
  std::sort(names.begin(), names.end());
  return names;
}

std::vector<std::string> sharedMemoryFilesOf(pid_t pid) {
  // fast_datasharing_ + vendor, host (2 bytes each), low two bytes of the process number, …
  char number[8];
  std::snprintf(number, sizeof number, ".%02x.%02x.", pid & 255, (pid >> 8) & 255);
  constexpr std::size_t kAt = sizeof "fast_datasharing_01.0f.78.fd" - 1;
  std::vector<std::string> names;
  for (const std::string& name : sharedMemoryFiles()) {
    if (name.rfind("fast_datasharing_", 0) == 0 && name.compare(kAt, 7, number) == 0) names.push_back(name);
  }
  return names;
}

bool alive(pid_t pid) {
  return kill(pid, 0) == 0;
}

std::string fileText(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

std::string testDataDir() {
  std::string folder = environment("OMNIFLEET_DATA");
  if (folder.empty()) folder = sourceDir() + "/../shared/data";
  return fs::is_directory(folder) ? folder : "";
}

pid_t childNamed(pid_t parent, const std::string& name) {
  const std::string proc = "/proc/" + std::to_string(parent);
  std::istringstream children(fileText(proc + "/task/" + std::to_string(parent) + "/children"));
  for (pid_t child = 0; children >> child;) {
    if (fileText("/proc/" + std::to_string(child) + "/comm") == name + "\n") return child;
  }
  return 0;
}

}  // namespace omnifleet::test
