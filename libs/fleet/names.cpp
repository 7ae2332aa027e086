#include "fleet/names.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

namespace omnifleet::fleet {
namespace {

constexpr std::size_t kNameLimit = 32;
constexpr std::size_t kCameraIdLimit = 64;
constexpr std::size_t kRobotLimit = 32;

bool isPlain(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '-' || c == '.';
}

struct NameChecker {
  std::string file;

  [[noreturn]] void fail(const std::string& problem) const { throw options::Error(file + ": " + problem); }

  void check(const char* what, const std::string& name, std::size_t limit) const {
    if (name.empty()) fail(fmt::format("{}: a name must not be empty", what));
    if (name.size() > limit) {
      fail(fmt::format("{} '{}': the name has {} characters; 1 to {} are allowed", what, name, name.size(),
                       limit));
    }
    if (!std::all_of(name.begin(), name.end(), isPlain)) {
      fail(fmt::format("{} '{}': a name may contain only letters, digits, '_', '-' and '.'", what, name));
    }
  }
};

}  // namespace

void checkNames(const Fleet& fleet) {
  const NameChecker checker{fleet.dataset.empty() ? fleet.file.file() : fleet.dataset};
  checker.check("fleet", fleet.name, kNameLimit);
  if (fleet.robots.size() > kRobotLimit) {
    checker.fail(fmt::format("robots: {} robots; 1 to {} are allowed", fleet.robots.size(), kRobotLimit));
  }
  for (const RobotSpec& robot : fleet.robots) checker.check("robot", robot.name, kNameLimit);
  for (std::size_t i = 1; i < fleet.robots.size(); ++i) {
    if (fleet.robots[i].name == fleet.robots[i - 1].name)
      checker.fail("robot '" + fleet.robots[i].name + "' is listed twice");
  }
  for (const CameraSpec& camera : fleet.cameras) {
    std::string id = camera.id;
    const auto slash = id.find('/');
    if (slash != std::string::npos) id[slash] = '_';
    checker.check("camera", id, kCameraIdLimit);
  }
}

}  // namespace omnifleet::fleet
