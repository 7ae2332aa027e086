#include "synthetic/arena.h"

namespace omnifleet::synthetic {

Arena randomised(const Arena& arena, std::uint32_t) {
  return arena;
}

}  // namespace omnifleet::synthetic
