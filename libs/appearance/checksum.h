#pragma once

#include <string>

namespace omnifleet::appearance {

/// SHA-256 (FIPS 180-4) as 64 hexadecimal digits, by OpenSSL. Throws std::runtime_error if the library fails.
std::string checksum(const std::string& bytes);

}  // namespace omnifleet::appearance
