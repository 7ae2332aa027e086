#include "launch/console.h"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <climits>

namespace omnifleet::launch {

void print(const std::string& text) {
  for (std::size_t done = 0; done < text.size();) {
    pollfd state{STDERR_FILENO, POLLOUT, 0};
    if (poll(&state, 1, 0) != 1 || (state.revents & POLLOUT) == 0) return;
    // A pipe that is ready takes PIPE_BUF bytes without waiting.
    const std::size_t part = std::min<std::size_t>(text.size() - done, PIPE_BUF);
    const ssize_t written = write(STDERR_FILENO, text.data() + done, part);
    if (written <= 0) return;
    done += static_cast<std::size_t>(written);
  }
}

}  // namespace omnifleet::launch
