#include "occupancy/sha256.h"

#include <openssl/evp.h>

#include <stdexcept>

namespace omnifleet::occupancy {

Sha256 sha256(const std::string& bytes) {
  Sha256 digest{};
  unsigned int length = 0;
  if (EVP_Digest(bytes.data(), bytes.size(), digest.data(), &length, EVP_sha256(), nullptr) != 1 ||
      length != digest.size()) {
    throw std::runtime_error("SHA-256 is not available from OpenSSL");
  }
  return digest;
}

}  // namespace omnifleet::occupancy
