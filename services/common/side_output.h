#pragma once

#include <optional>
#include <stdexcept>
#include <utility>

#include "bus/status_board.h"
#include "common/messages.h"

namespace omnifleet::services {

/// A file that a stage writes besides its output topics (a recording, its classifications). When the file
/// cannot be opened or written (disk full), the status reports it once and the stage continues without the
/// file.
template <class Writer>
class SideOutput {
 public:
  template <class... Arguments>
  void open(bus::StatusBoard& status, Arguments&&... arguments) {
    try {
      writer_.emplace(std::forward<Arguments>(arguments)...);
    } catch (const std::runtime_error& problem) {
      status.report(fileWriteFailed(problem.what()), true);
    }
  }
  template <class Write>
  void write(bus::StatusBoard& status, Write&& write) {
    if (!writer_) return;
    try {
      write(*writer_);
    } catch (const std::runtime_error& problem) {
      writer_.reset();
      status.report(fileWriteFailed(problem.what()), true);
    }
  }

 private:
  std::optional<Writer> writer_;
};

}  // namespace omnifleet::services
