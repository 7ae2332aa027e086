#pragma once

#include <array>
#include <cstdint>
#include <string>

namespace omnifleet::occupancy {

using Sha256 = std::array<std::uint8_t, 32>;

/// SHA-256 (FIPS 180-4), by OpenSSL. Throws std::runtime_error if the library fails.
Sha256 sha256(const std::string& bytes);

}  // namespace omnifleet::occupancy
