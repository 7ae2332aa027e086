#include "common/fault_runs.h"

#include <fmt/format.h>

namespace omnifleet::services {

std::vector<Message> FaultRuns::add(const std::string& where, const Message& fault) {
  if (fault == fault_) {
    ++frames_;
    return {};
  }
  std::vector<Message> messages = end();
  fault_ = fault;
  frames_ = 1;
  if (fault.code != ErrorCode::kNone)
    messages.push_back({fault.code, fmt::format("{}: {}; frame rejected", where, fault.text)});
  return messages;
}

std::vector<Message> FaultRuns::end() {
  std::vector<Message> messages;
  if (fault_.code != ErrorCode::kNone && frames_ > 1)
    messages.push_back(
        {fault_.code, fmt::format("{} consecutive frames rejected: {}", frames_, fault_.text)});
  fault_ = {};
  return messages;
}

}  // namespace omnifleet::services
