#pragma once

#include <algorithm>
#include <cstdint>

namespace omnifleet::services {

/// Which poses count where several localizers have published some: those with the greatest term so far. A
/// localizer that was cut off or suspended may publish for a moment after another one has taken over.
class NewestTerm {
 public:
  bool accepts(std::uint32_t term) {
    newest_ = std::max(newest_, term);
    return term == newest_;
  }

 private:
  std::uint32_t newest_ = 0;
};

}  // namespace omnifleet::services
