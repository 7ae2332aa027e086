#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "observation/error_code.h"

namespace omnifleet::services {

/// Messages about rejected frames: of several in a row with the same fault only the first is reported, and
/// their number when the run is over. The status counts each.
class FaultRuns {
 public:
  /// One frame. @param where names the frame @param fault its code is kNone for a good frame
  /// @return the messages to report
  std::vector<Message> add(const std::string& where, const Message& fault);
  /// The stream has ended. @return the messages to report
  std::vector<Message> end();

 private:
  Message fault_;  ///< of the preceding frames
  std::uint64_t frames_ = 0;
};

}  // namespace omnifleet::services
