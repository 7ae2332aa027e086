#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <vector>

#include "dataset/capture.h"

namespace omnifleet::dataset {
namespace {
namespace fs = std::filesystem;

bool isVideoNode(const fs::path& path) {
  const std::string name = path.filename().string();
  constexpr std::size_t kPrefix = 5;  // "video"
  return name.rfind("video", 0) == 0 && name.size() > kPrefix &&
         name.find_first_not_of("0123456789", kPrefix) == std::string::npos;
}

bool exists(const std::string& path) {
  std::error_code ignored;
  return fs::exists(path, ignored);
}

/// Sorted, so that the choice does not depend on the order of the folder.
std::vector<std::string> entries(const std::string& folder) {
  std::vector<std::string> all;
  std::error_code error;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error))
    all.push_back(at->path().string());
  std::sort(all.begin(), all.end());
  return all;
}

}  // namespace

DevicePath::DevicePath(const std::string& device, Places places)
    : device_(device), places_(std::move(places)) {
  const bool number =
      !device.empty() && device.size() < 4 && device.find_first_not_of("0123456789") == std::string::npos;
  if (number) device_ = places_.nodes + "/video" + device;
  is_file_ = number || device.rfind("/", 0) == 0;
  is_link_ = is_file_ && !isVideoNode(device_);
}

std::string DevicePath::find(std::string& fault) const {
  if (!is_file_) return device_;
  if (!is_link_ && was_opened_) return findAgain(fault);
  std::error_code error;
  const fs::path node = fs::canonical(device_, error);
  if (!error) return node.string();
  fault = device_ + " does not exist";
  return {};
}

std::string DevicePath::findAgain(std::string& fault) const {
  if (!link_.empty()) {
    std::error_code error;
    const fs::path node = fs::canonical(link_, error);
    if (!error) return node.string();
    fault = fmt::format("{} ({}) is not connected", device_, fs::path(link_).filename().string());
    return {};
  }
  if (!identity_) {
    if (exists(device_)) return device_;
    fault = device_ + " does not exist";
    return {};
  }
  std::vector<std::string> same_model;
  for (const std::string& node : entries(places_.nodes)) {
    if (!isVideoNode(node)) continue;
    const std::optional<DeviceIdentity> found = places_.identify(node);
    if (!found || found->card != identity_->card) continue;
    if (found->bus == identity_->bus) return node;
    same_model.push_back(node);
  }
  if (same_model.size() == 1) return same_model.front();
  fault = same_model.empty() ? fmt::format("{} ({}) is not connected", device_, identity_->card)
                             : fmt::format("{} devices are a {}; name this camera by its link in {}",
                                           same_model.size(), identity_->card, places_.by_id);
  return {};
}

void DevicePath::opened(const std::string& node) {
  if (was_opened_ || !is_file_) return;
  was_opened_ = true;
  if (is_link_) return;
  for (const std::string& link : entries(places_.by_id)) {
    std::error_code error;
    if (fs::canonical(link, error) == fs::path(node) && !error) link_ = link;
    if (!link_.empty()) return;
  }
  if (places_.identify) identity_ = places_.identify(node);
}

}  // namespace omnifleet::dataset
