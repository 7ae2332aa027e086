#include "tests/experiments/fernandez/compass_range.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "appearance/compass.h"
#include "tests/experiments/fernandez/study.h"

namespace omnifleet::fernandez {
namespace {

constexpr double kRight_deg = 3.0;  // what the confidence of the compass promises

double distance_m(const ImageSet& set, const ImagePair& pair) {
  return (set.images[pair.second].truth.translation() - set.images[pair.first].truth.translation()).norm();
}

double inDegrees(double rad) {
  return rad * 180.0 / M_PI;
}

/// The displacement by the wheels in the frame halfway between both headings.
appearance::TravelHint hintByWheels(const SetImage& from, const SetImage& to) {
  const Pose2 from_to = from.odometry.inverse() * to.odometry;
  appearance::TravelHint hint;
  hint.distance_m = from_to.translation().norm();
  hint.bearing_rad = wrapAngle(std::atan2(from_to.y_m, from_to.x_m) - 0.5 * from_to.theta_rad);
  return hint;
}

/// Eq. 2 with the modules of k1 = 64, divided by the mean norm of both signatures.
double relativeDifference(const appearance::Signature& a, const appearance::Signature& b) {
  const auto of_a = a.modules.leftCols(kFigureTerms), of_b = b.modules.leftCols(kFigureTerms);
  const auto mean = 0.5 * static_cast<double>(of_a.matrix().norm() + of_b.matrix().norm());
  return mean > 0.0 ? static_cast<double>((of_a - of_b).matrix().norm()) / mean : 0.0;
}

/// A compass with what it needs of all images of a set.
class Prepared {
 public:
  Prepared(const ImageSet& set, appearance::CompassMethod method) {
    appearance::CompassOptions options;
    options.method = method;
    options.k2 = kFigureTerms;
    compass_ = appearance::Compass(options);
    for (const SetImage& image : set.images)
      views_.push_back(
          compass_.prepare(method == appearance::CompassMethod::kLiteral ? image.rows : image.pooled));
  }
  appearance::CompassResult compare(const ImagePair& pair, const appearance::TravelHint& hint) {
    return compass_.compare(views_[pair.first], views_[pair.second], hint);
  }

 private:
  appearance::Compass compass_;
  std::vector<appearance::Compass::View> views_;
};

}  // namespace

Spread spreadOf(std::vector<double> values) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  if (values.empty()) return {kNone, kNone, kNone};
  std::sort(values.begin(), values.end());
  const auto at = [&](double q) {
    const double index = q * static_cast<double>(values.size() - 1);
    const auto below = static_cast<std::size_t>(index);
    const std::size_t above = std::min(below + 1, values.size() - 1);
    return values[below] + (index - static_cast<double>(below)) * (values[above] - values[below]);
  };
  return {at(0.1), at(0.5), at(0.9)};
}

std::size_t binOf(double distance_m, double bin_m) {
  constexpr double kRounding = 1e-9;
  return static_cast<std::size_t>(std::floor(distance_m / bin_m + kRounding));
}

std::vector<ImagePair> choosePairs(const ImageSet& set, const RangeOptions& options) {
  std::vector<ImagePair> all;
  for (std::size_t i = 0; i < set.images.size(); ++i)
    for (std::size_t j = i + 1; j < set.images.size(); ++j) all.push_back({i, j});
  // std::shuffle may differ between libraries.
  std::mt19937 random(options.seed);
  for (std::size_t i = all.size(); i > 1; --i) std::swap(all[i - 1], all[random() % i]);
  std::vector<int> taken(binOf(options.most_m, options.bin_m), 0);
  std::vector<ImagePair> chosen;
  for (const ImagePair& pair : all) {
    const std::size_t bin = binOf(distance_m(set, pair), options.bin_m);
    if (bin >= taken.size() || taken[bin] >= options.most_pairs) continue;
    ++taken[bin];
    chosen.push_back(pair);
  }
  std::sort(chosen.begin(), chosen.end(), [](const ImagePair& a, const ImagePair& b) {
    return a.first != b.first ? a.first < b.first : a.second < b.second;
  });
  return chosen;
}

std::vector<ComparedPair> comparePairs(const ImageSet& set, const std::vector<ImagePair>& pairs) {
  Prepared literal(set, appearance::CompassMethod::kLiteral),
      parallax(set, appearance::CompassMethod::kParallax);
  std::vector<ComparedPair> compared;
  for (const ImagePair& pair : pairs) {
    const SetImage &from = set.images[pair.first], &to = set.images[pair.second];
    const auto errorOf = [&](const appearance::CompassResult& found) {
      return std::abs(wrapAngle(found.turn_rad - (to.truth.theta_rad - from.truth.theta_rad)));
    };
    ComparedPair next;
    next.distance_m = distance_m(set, pair);
    next.literal_error_rad = errorOf(literal.compare(pair, {}));
    next.images_error_rad = errorOf(parallax.compare(pair, {}));
    const auto found =
        parallax.compare(pair, set.has_wheels ? hintByWheels(from, to) : appearance::TravelHint());
    next.omnifleet_error_rad = errorOf(found);
    next.confidence = found.confidence;
    next.literal_difference = relativeDifference(from.rows, to.rows);
    next.omnifleet_difference = relativeDifference(from.pooled, to.pooled);
    compared.push_back(next);
  }
  return compared;
}

std::vector<DistanceBin> binned(const std::vector<ComparedPair>& pairs, const RangeOptions& options) {
  struct Values {
    std::vector<double> literal, images, omnifleet, sure, literal_difference, omnifleet_difference;
  };
  std::vector<Values> values(binOf(options.most_m, options.bin_m));
  std::vector<DistanceBin> bins(values.size());
  for (const ComparedPair& pair : pairs) {
    const std::size_t index = binOf(pair.distance_m, options.bin_m);
    if (index >= bins.size()) continue;
    DistanceBin& bin = bins[index];
    Values& of_bin = values[index];
    const double literal_deg = inDegrees(pair.literal_error_rad),
                 omnifleet_deg = inDegrees(pair.omnifleet_error_rad);
    ++bin.pairs;
    bin.literal_right += literal_deg < kRight_deg ? 1 : 0;
    of_bin.literal.push_back(literal_deg);
    of_bin.images.push_back(inDegrees(pair.images_error_rad));
    of_bin.omnifleet.push_back(omnifleet_deg);
    of_bin.literal_difference.push_back(pair.literal_difference);
    of_bin.omnifleet_difference.push_back(pair.omnifleet_difference);
    const int right = omnifleet_deg < kRight_deg ? 1 : 0;
    bin.omnifleet_right += right;
    if (pair.confidence >= kUsable) ++bin.usable, bin.usable_right += right;
    if (pair.confidence < kSure) continue;
    ++bin.sure, bin.sure_right += right;
    of_bin.sure.push_back(omnifleet_deg);
  }
  for (std::size_t i = 0; i < bins.size(); ++i) {
    bins[i].from_m = options.bin_m * static_cast<double>(i);
    bins[i].to_m = options.bin_m * static_cast<double>(i + 1);
    bins[i].literal_deg = spreadOf(values[i].literal);
    bins[i].images_deg = spreadOf(values[i].images);
    bins[i].omnifleet_deg = spreadOf(values[i].omnifleet);
    bins[i].sure_deg = spreadOf(values[i].sure);
    bins[i].literal_difference = spreadOf(values[i].literal_difference);
    bins[i].omnifleet_difference = spreadOf(values[i].omnifleet_difference);
  }
  return bins;
}

std::string toCsv(const std::vector<DistanceBin>& bins) {
  std::string text =
      "#from [m],to [m],pairs,literal right,omnifleet right,confidence from 0.1,of these right,"
      "confidence from 0.9,of these right,literal median [deg],literal 90 % [deg],images alone median [deg],"
      "images alone 90 % [deg],omnifleet median [deg],omnifleet 90 % [deg],confidence from 0.9 median [deg],"
      "confidence from 0.9 90 % [deg],D literal 10 %,D literal median,D literal 90 %,D omnifleet 10 %,"
      "D omnifleet median,D omnifleet 90 %\n";
  for (const DistanceBin& bin : bins) {
    text +=
        fmt::format("{:.2f},{:.2f},{},{},{},{},{},{},{}", bin.from_m, bin.to_m, bin.pairs, bin.literal_right,
                    bin.omnifleet_right, bin.usable, bin.usable_right, bin.sure, bin.sure_right);
    for (const Spread& error : {bin.literal_deg, bin.images_deg, bin.omnifleet_deg, bin.sure_deg})
      text += fmt::format(",{:.3f},{:.3f}", error.median, error.high);
    for (const Spread& difference : {bin.literal_difference, bin.omnifleet_difference})
      text += fmt::format(",{:.4f},{:.4f},{:.4f}", difference.low, difference.median, difference.high);
    text += "\n";
  }
  return text;
}

}  // namespace omnifleet::fernandez
