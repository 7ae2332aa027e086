#include "bus/domain_claim.h"

#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstring>
#include <system_error>

#include "options/options.h"

namespace omnifleet::bus {

DomainClaim::DomainClaim(int domain, const std::string& host) {
  socket_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (socket_ < 0) throw std::system_error(errno, std::generic_category(), "socket");
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  // An abstract name begins with a zero byte.
  const std::string name =
      fmt::format("omnifleet/{}/{}", domain, host).substr(0, sizeof address.sun_path - 1);
  std::memcpy(address.sun_path + 1, name.data(), name.size());
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
  if (bind(socket_, reinterpret_cast<const sockaddr*>(&address), size) == 0) return;
  const int error = errno;
  close(socket_);
  if (error != EADDRINUSE) throw std::system_error(error, std::generic_category(), "bind");
  throw options::Error(
      fmt::format("DDS domain {} is in use by another fleet on this machine; wait for its end or "
                  "choose another domain: --domain {}",
                  domain, domain + 1));
}

DomainClaim::~DomainClaim() {
  close(socket_);
}

}  // namespace omnifleet::bus
