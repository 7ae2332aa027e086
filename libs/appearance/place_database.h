#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::appearance {

struct PlaceDatabaseOptions {
  int modules = 16;  ///< modules per stored row that are compared, at most those that are stored
  /// Keys: modules.
  static PlaceDatabaseOptions read(const options::Section& section);
};

/// Finds the places that look most alike, whatever the heading: nearest neighbours among stored signatures by
/// the L1 distance of the logarithms of the modules, one byte each. Logarithms, because modules of low
/// frequencies are many times those of the others. Each counts relative to the geometric mean of its
/// signature, so exposure does not matter.
class PlaceDatabase {
 public:
  struct Match {
    std::uint32_t index = 0;  ///< of the place, in the order of add()
    double distance = 0.0;    ///< mean over all modules of |ln of their ratio|
  };

  explicit PlaceDatabase(const SignatureFormat& format, const PlaceDatabaseOptions& options = {});

  /// @return index of the place. Throws std::invalid_argument that names the field for another format, or for
  /// sizes that contradict it.
  std::uint32_t add(const SignatureFormat& format, const StoredSignature& signature);

  /// At most `count` places, the nearest first; of equal distances the lower index first. @param end only
  /// places with an index below `end`. Throws like add(). Deterministic; not thread safe (buffers).
  std::vector<Match> nearest(const SignatureFormat& format, const StoredSignature& signature,
                             std::size_t count, std::size_t end = SIZE_MAX);

  std::size_t size() const { return stride_ > 0 ? cells_.size() / stride_ : 0; }
  const SignatureFormat& format() const { return format_; }

 private:
  void require(const SignatureFormat& format, const StoredSignature& signature) const;
  void describe(const StoredSignature& signature, std::uint8_t* out);

  SignatureFormat format_;
  std::size_t modules_, stride_;  ///< bytes per place, a multiple of 64
  std::vector<std::uint8_t> cells_, query_;
  std::vector<float> logs_;
  std::vector<std::uint32_t> sums_;
};

}  // namespace omnifleet::appearance
