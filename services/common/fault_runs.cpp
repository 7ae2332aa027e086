#include "common/fault_runs.h"

#include <fmt/format.h>

namespace omnifleet::services {

std::vector<std::string> FaultRuns::add(const std::string& where, const std::string& fault) {
  if (fault == fault_) {
    ++frames_;
    return {};
  }
  std::vector<std::string> said = end();
  fault_ = fault;
  frames_ = 1;
  if (!fault.empty()) said.push_back(where + ": " + fault);
  return said;
}

std::vector<std::string> FaultRuns::end() {
  std::vector<std::string> said;
  if (!fault_.empty() && frames_ > 1) said.push_back(fmt::format("{} frames in a row: {}", frames_, fault_));
  fault_.clear();
  return said;
}

}  // namespace omnifleet::services
