#include "appearance/place_database.h"

#include <Eigen/Core>
#include <algorithm>
#include <stdexcept>

#include "appearance/signature.h"
#include "appearance/stored_signature.h"
#include "geometry/wide.h"

namespace omnifleet::appearance {
namespace {

constexpr std::size_t kBlock = 64;  // bytes, a line of the cache

// A module becomes the byte kMiddle + kPerFactor · ln of its ratio to the geometric mean of the signature.
constexpr float kMiddle = 128.0f, kPerFactor = 24.0f;
constexpr float kNoise = 0.3f;  // grey levels: modules below are noise

/// L1 distances of one signature to all places. @param stride a multiple of kBlock
OMNIFLEET_WIDE void sumDifferences(const std::uint8_t* query, const std::uint8_t* cells, std::size_t stride,
                                   std::size_t places, std::uint32_t* sums) {
  for (std::size_t i = 0; i < places; ++i) {
    const std::uint8_t* place = cells + i * stride;
    std::uint32_t sum = 0;
    for (std::size_t k = 0; k < stride; ++k) {
      const int difference = query[k] - place[k];
      sum += static_cast<std::uint32_t>(difference < 0 ? -difference : difference);
    }
    sums[i] = sum;
  }
}

}  // namespace

PlaceDatabaseOptions PlaceDatabaseOptions::read(const options::Section& section) {
  PlaceDatabaseOptions o;
  section.read("modules", o.modules, {1, 2048});
  section.finish();
  return o;
}

PlaceDatabase::PlaceDatabase(const SignatureFormat& format, const PlaceDatabaseOptions& options)
    : format_(format),
      modules_(std::min<std::size_t>(static_cast<std::size_t>(options.modules), format.stored_modules)),
      stride_((format.stored_rows * modules_ + kBlock - 1) / kBlock * kBlock),
      query_(stride_),
      logs_(format.stored_rows * modules_) {}

void PlaceDatabase::require(const SignatureFormat& format, const StoredSignature& signature) const {
  if (const std::string reason = whyIncomparable(format_, format); !reason.empty())
    throw std::invalid_argument("the signature does not fit the places of the map: " + reason);
  if (const std::string reason = whyMalformed(format, signature); !reason.empty())
    throw std::invalid_argument("the signature does not fit the places of the map: " + reason);
}

void PlaceDatabase::describe(const StoredSignature& signature, std::uint8_t* out) {
  const std::size_t per_row = std::size_t{format_.stored_modules} + format_.stored_phases;
  Eigen::Map<Eigen::ArrayXf> logs(logs_.data(), static_cast<Eigen::Index>(logs_.size()));
  for (std::size_t row = 0; row < format_.stored_rows; ++row) {
    const float unit = signature.scale[row] / 255.0f;
    for (std::size_t k = 0; k < modules_; ++k)
      logs_[row * modules_ + k] = kNoise + unit * static_cast<float>(signature.bytes[row * per_row + k]);
  }
  logs = logs.log();
  logs = (kMiddle + 0.5f + kPerFactor * (logs - logs.mean())).max(0.0f).min(255.0f);
  for (std::size_t i = 0; i < logs_.size(); ++i) out[i] = static_cast<std::uint8_t>(logs_[i]);
}

std::uint32_t PlaceDatabase::add(const SignatureFormat& format, const StoredSignature& signature) {
  require(format, signature);
  cells_.resize(cells_.size() + stride_, 0);
  describe(signature, cells_.data() + cells_.size() - stride_);
  return static_cast<std::uint32_t>(size() - 1);
}

std::vector<PlaceDatabase::Match> PlaceDatabase::nearest(const SignatureFormat& format,
                                                         const StoredSignature& signature, std::size_t count,
                                                         std::size_t end) {
  require(format, signature);
  describe(signature, query_.data());
  const std::size_t places = std::min(size(), end);
  sums_.resize(std::max(sums_.size(), places));
  sumDifferences(query_.data(), cells_.data(), stride_, places, sums_.data());

  // The best are few, so a sorted list of them is shorter than a heap of all.
  std::vector<Match> best;
  best.reserve(std::min(count, places) + 1);
  const double scale = 1.0 / (static_cast<double>(kPerFactor) * static_cast<double>(logs_.size()));
  std::uint32_t limit = UINT32_MAX;
  for (std::size_t i = 0; i < places && count > 0; ++i) {
    if (sums_[i] >= limit) continue;
    const Match match{static_cast<std::uint32_t>(i), static_cast<double>(sums_[i]) * scale};
    best.insert(std::upper_bound(best.begin(), best.end(), match,
                                 [](const Match& a, const Match& b) { return a.distance < b.distance; }),
                match);
    if (best.size() > count) best.pop_back();
    if (best.size() == count) limit = sums_[best.back().index];
  }
  return best;
}

}  // namespace omnifleet::appearance
