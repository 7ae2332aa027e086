#include "bus/idle_window.h"

namespace omnifleet::bus {

void awaitIdleWindow(Bus& bus, IdleWindow& idle_window, const std::function<bool()>& pull) {
  idle_window.onUse();
  while (!bus.stopping()) {
    if (pull()) idle_window.onInput(IdleWindow::Clock::now());
    const auto now = IdleWindow::Clock::now();
    if (idle_window.isOpen(now)) return;
    bus.wait(idle_window.opensAt(now) - now);
  }
}

}  // namespace omnifleet::bus
