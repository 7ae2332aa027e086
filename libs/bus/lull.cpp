#include "bus/lull.h"

namespace omnifleet::bus {

void awaitLull(Bus& bus, const std::function<bool()>& pull) {
  Lull lull;
  while (!bus.stopping()) {
    if (pull()) lull.heard(Lull::Clock::now());
    const auto now = Lull::Clock::now();
    if (lull.here(now)) return;
    bus.wait(lull.begins() - now);
  }
}

}  // namespace omnifleet::bus
