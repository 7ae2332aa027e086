#include "appearance/compass.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "geometry/pose2.h"

namespace omnifleet::appearance {

CompassOptions CompassOptions::read(const options::Section& section) {
  CompassOptions o;
  std::string method = "parallax";
  section.read("method", method, {"literal", "parallax"});
  o.method = method == "literal" ? CompassMethod::kLiteral : CompassMethod::kParallax;
  section.read("k2", o.k2, {1, 2048});
  section.read("rival_ratio", o.rival_ratio, {0.0, 1.0});
  section.read("max_rivals", o.max_rivals, {0, 10});
  section.read("confidence_offset", o.confidence_offset, {-100.0, 100.0});
  section.read("confidence_match", o.confidence_match, {-100.0, 100.0});
  section.read("confidence_sectors", o.confidence_sectors, {-100.0, 100.0});
  section.read("unknown_bearing_share", o.unknown_bearing_share, {0.0, 10.0});
  section.read("least_confidence", o.least_confidence, {0.0, 1.0});
  o.parallax = ParallaxOptions::read(section.child("parallax"));
  section.finish();
  return o;
}

Compass::Compass(const CompassOptions& options) : options_(options), fit_(options.parallax) {}

void Compass::prepare(const Signature& signature, View& view) const {
  if (signature.spectrum.cols() < options_.k2)
    throw std::invalid_argument(fmt::format("compass: k2 is {}, the signature has {} phases per row",
                                            options_.k2, signature.spectrum.cols()));
  view.format = signature.format;
  view.spectrum = signature.spectrum.leftCols(options_.k2);
  if (options_.method == CompassMethod::kLiteral)
    view.spectrum = view.spectrum.unaryExpr([](const std::complex<float>& z) {
      const float size = std::abs(z);
      return size > 0.0f ? z / size : std::complex<float>();
    });
  view.norm = static_cast<double>(view.spectrum.matrix().norm());
  if (options_.method == CompassMethod::kParallax)
    fit_.prepare(signature.spectrum, signature.weight, view.bands);
}

Compass::View Compass::prepare(const Signature& signature) const {
  View view;
  prepare(signature, view);
  return view;
}

/// Circular correlation over all turns, by the inverse transform of the cross spectrum summed over the rows.
void Compass::correlate(const View& from, const View& to) {
  cross_ = (to.spectrum * from.spectrum.conjugate()).colwise().sum().transpose();
  packed_.create(1, from.format.columns);
  packed_.setTo(0.0f);
  const auto norm = static_cast<float>(from.norm * to.norm);
  if (norm > 0.0f) cross_ /= norm;
  for (int k = 1; k <= options_.k2; ++k) {
    // The spectrum of real rows: half of each term belongs to the negative frequency. The turn has the sign
    // of a phase, so the transform is the forward one's conjugate.
    packed_(0, 2 * k - 1) = 0.5f * cross_[k - 1].real();
    packed_(0, 2 * k) = -0.5f * cross_[k - 1].imag();
  }
  cv::idft(packed_, correlation_, cv::DFT_ROWS | cv::DFT_REAL_OUTPUT);
}

/// Highest peak first. Heights are refined between the columns unless the method is literal.
std::vector<Compass::Peak> Compass::findPeaks() const {
  const int columns = correlation_.cols;
  std::vector<Peak> peaks;
  for (int c = 0; c < columns; ++c) {
    const float here = correlation_(0, c), before = correlation_(0, (c + columns - 1) % columns),
                after = correlation_(0, (c + 1) % columns);
    if (here >= before && here > after) peaks.push_back(refine(c));
  }
  std::sort(peaks.begin(), peaks.end(), [](const Peak& a, const Peak& b) {
    return a.height != b.height ? a.height > b.height : a.turn_rad < b.turn_rad;
  });
  return peaks;
}

/// Newton's method for the maximum of c(φ) = Σ Re(C_k exp(−ikφ)), from a whole column.
Compass::Peak Compass::refine(int column) const {
  const double width = 2.0 * M_PI / correlation_.cols;
  Peak peak{column * width, static_cast<double>(correlation_(0, column))};
  if (options_.method == CompassMethod::kLiteral) return peak;
  constexpr int kIterations = 3;
  double turn = peak.turn_rad;
  for (int i = 0; i <= kIterations; ++i) {
    const std::complex<double> turned = std::polar(1.0, -turn);
    std::complex<double> phase = 1.0;
    double value = 0.0, slope = 0.0, curvature = 0.0;
    for (int k = 1; k <= options_.k2; ++k) {
      phase *= turned;
      const std::complex<double> term = std::complex<double>(cross_[k - 1]) * phase;
      value += term.real();
      slope += k * term.imag();
      curvature -= k * k * term.real();
    }
    if (i == kIterations || !(curvature < 0.0)) {
      if (curvature < 0.0 && std::abs(turn - column * width) <= width) peak = {turn, value};
      break;
    }
    turn -= slope / curvature;
  }
  return peak;
}

double Compass::confidence(const CompassResult& result) const {
  if (options_.method == CompassMethod::kLiteral)
    return std::max(0.0, result.height - std::max(0.0, result.rival_height));
  const double sectors = std::min(1.0, result.sectors / options_.parallax.fewest_sectors),
               score = options_.confidence_offset + options_.confidence_match * result.match +
                       options_.confidence_sectors * sectors;
  return 1.0 / (1.0 + std::exp(-score));
}

CompassResult Compass::compare(const View& from, const View& to, const TravelHint& hint) {
  if (const std::string reason = whyIncomparable(from.format, to.format); !reason.empty())
    throw std::invalid_argument("compass: signatures cannot be compared: " + reason);
  CompassResult result;
  if (!(from.norm > 0.0 && to.norm > 0.0)) return result;
  correlate(from, to);
  const std::vector<Peak> peaks = findPeaks();
  if (peaks.empty()) return result;
  result.height = peaks[0].height;
  result.rival_height = peaks.size() > 1 ? peaks[1].height : -1.0;
  result.turn_rad = wrapAngle(peaks[0].turn_rad);
  result.match = result.height;
  result.sigma_rad = M_PI / from.format.columns;
  if (options_.method == CompassMethod::kParallax) {
    const ParallaxFit::Band band{static_cast<double>(from.format.least_elevation_rad),
                                 static_cast<double>(from.format.most_elevation_rad)};
    ParallaxFit::Result best;
    for (std::size_t i = 0; i < peaks.size() && i <= static_cast<std::size_t>(options_.max_rivals); ++i) {
      if (i > 0 && peaks[i].height < options_.rival_ratio * peaks[0].height) break;
      const auto fit =
          fit_.solve(from.bands, to.bands, peaks[i].turn_rad, hint.bearing_rad, hint.distance_m, band);
      if (fit.valid && (!best.valid || fit.match > best.match)) best = fit;
    }
    if (!best.valid) return result;
    result.turn_rad = best.turn_rad;
    const double bearing_sigma = hint.bearing_sigma_rad >= 0.0
                                     ? hint.bearing_sigma_rad
                                     : options_.unknown_bearing_share * std::abs(best.turn_rad);
    result.sigma_rad = std::hypot(best.sigma_rad, best.turn_by_bearing * bearing_sigma);
    result.match = best.match;
    result.parallax_rad = best.parallax_rad;
    result.sectors = best.sectors;
  }
  result.confidence = confidence(result);
  result.valid = result.confidence >= options_.least_confidence;
  return result;
}

}  // namespace omnifleet::appearance
