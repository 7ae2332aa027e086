#include "bus/lull.h"

namespace omnifleet::bus {

void awaitLull(Bus& bus, Lull& lull, const std::function<bool()>& pull) {
  lull.used();
  while (!bus.stopping()) {
    if (pull()) lull.heard(Lull::Clock::now());
    const auto now = Lull::Clock::now();
    if (lull.here(now)) return;
    bus.wait(lull.next(now) - now);
  }
}

}  // namespace omnifleet::bus
