#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tests/experiments/fernandez/image_set.h"

namespace omnifleet::fernandez {

/// Distance up to which the paper's turns are valid (§III.B), metres.
inline constexpr double kPaperRange_m = 0.8;

/// Two images of one set, by their indices, first < second.
struct ImagePair {
  std::size_t first = 0, second = 0;
  bool operator==(const ImagePair& other) const { return first == other.first && second == other.second; }
};

/// What two images measure of each other, against the truth.
struct ComparedPair {
  double distance_m = 0.0;            ///< true one
  double literal_error_rad = 0.0;     ///< absolute error of the turn: compass as printed, k2 = 64
  double images_error_rad = 0.0;      ///< compass of omnifleet from the images alone: motion assumed forward
  double omnifleet_error_rad = 0.0;   ///< compass of omnifleet, direction of travel by the wheels
  double confidence = 0.0;            ///< of the latter
  double literal_difference = 0.0;    ///< D (eq. 2) ÷ mean norm, 64 rows near the horizon, k1 = 64
  double omnifleet_difference = 0.0;  ///< likewise, signatures of omnifleet
};

/// Order statistics of one quantity; NaN without values.
struct Spread {
  double low = 0.0, median = 0.0, high = 0.0;  ///< 10 %, 50 % and 90 %
};
/// Linear between the order statistics: of n sorted values, quantile q lies at index q (n − 1).
Spread spreadOf(std::vector<double> values);

/// The pairs whose distance lies in [from_m, to_m). Right: the error of the turn is below 3°.
struct DistanceBin {
  double from_m = 0.0, to_m = 0.0;
  int pairs = 0;
  int literal_right = 0, omnifleet_right = 0;
  int usable = 0, usable_right = 0;                         ///< pairs of at least kUsable
  int sure = 0, sure_right = 0;                             ///< pairs of at least kSure
  Spread literal_deg, images_deg, omnifleet_deg, sure_deg;  ///< absolute errors
  Spread literal_difference, omnifleet_difference;
};

inline constexpr double kUsable = 0.1;  ///< confidence below which the compass gives no answer by default
inline constexpr double kSure = 0.9;    ///< confidence of nearly certain answers

struct RangeOptions {
  double bin_m = 0.1, most_m = 3.0;
  int most_pairs = 60;  ///< per bin and set
  std::uint32_t seed = 1;
};

/// Index of the bin of a distance. A distance on an edge, up to rounding, belongs to the upper bin.
std::size_t binOf(double distance_m, double bin_m);

/// Some pairs of a set, equally likely within each bin, no pair twice, sorted. Equal input gives equal pairs.
std::vector<ImagePair> choosePairs(const ImageSet& set, const RangeOptions& options);

/// @param pairs of choosePairs()
std::vector<ComparedPair> comparePairs(const ImageSet& set, const std::vector<ImagePair>& pairs);

/// All bins from 0 to most_m, empty ones too. Pairs from most_m on are left out.
std::vector<DistanceBin> binned(const std::vector<ComparedPair>& pairs, const RangeOptions& options);

/// One row per bin, with a heading.
std::string toCsv(const std::vector<DistanceBin>& bins);

/// Three panels over the true distance: errors of the compasses, shares of the pairs, difference of the
/// signatures.
void drawCompassRange(const std::vector<DistanceBin>& bins, const std::string& file);

}  // namespace omnifleet::fernandez
