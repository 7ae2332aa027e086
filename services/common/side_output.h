#pragma once

#include <optional>
#include <stdexcept>
#include <utility>

#include "bus/status_board.h"

namespace omnifleet::services {

/// A file that a stage writes beside its work (a recording, what it took each track for). When it cannot be
/// written, from the start or any more (disk full), the status says so once and the stage goes on without it.
template <class Writer>
class SideOutput {
 public:
  template <class... Arguments>
  void open(bus::StatusBoard& status, Arguments&&... arguments) {
    try {
      writer_.emplace(std::forward<Arguments>(arguments)...);
    } catch (const std::runtime_error& problem) {
      status.error(problem.what(), true);
    }
  }
  template <class Write>
  void write(bus::StatusBoard& status, Write&& write) {
    if (!writer_) return;
    try {
      write(*writer_);
    } catch (const std::runtime_error& problem) {
      writer_.reset();
      status.error(problem.what(), true);
    }
  }

 private:
  std::optional<Writer> writer_;
};

}  // namespace omnifleet::services
