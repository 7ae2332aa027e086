#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>

#include "appearance/parallax_fit.h"
#include "appearance/signature.h"
#include "options/options.h"

namespace omnifleet::appearance {

enum class CompassMethod {
  kLiteral,  ///< §III.B: circular correlation of the phases, whole columns
  kParallax  ///< amplitude weights, sub-column, then least squares that separates parallax from rotation
};

struct CompassOptions {
  CompassMethod method = CompassMethod::kParallax;
  int k2 = 64;               ///< frequencies of the correlation
  double rival_ratio = 0.8;  ///< peaks of the correlation this high, relative to the highest, are tried too
  int max_rivals = 2;        ///< how many of them, at most
  ParallaxOptions parallax;
  // Confidence of the parallax method: 1/(1 + exp(−(offset + …))), see docs/methods/appearance.md.
  double confidence_offset = -17.0, confidence_match = 17.3, confidence_sectors = 4.5;
  double unknown_bearing_share = 0.4;  ///< σ of the direction of travel where unknown, as a share of the turn
  double least_confidence = 0.1;       ///< below, the compass gives no answer
  /// Keys: method (literal, parallax) and the names above; section parallax.
  static CompassOptions read(const options::Section& section);
};

/// What is known about the motion between two panoramas.
struct TravelHint {
  /// Direction of the displacement in the frame halfway between both headings; 0: forward, as of a robot with
  /// differential drive.
  double bearing_rad = 0.0;
  /// Its σ. Negative: unknown, as without wheels; a share of the turn is assumed, because the robot may turn
  /// on the spot between the two images.
  double bearing_sigma_rad = 0.02;
  /// Length of the displacement, metres; negative: unknown.
  double distance_m = -1.0;
};

struct CompassResult {
  bool valid = false;         ///< false: nothing to compare, or the confidence is too low
  double turn_rad = 0.0;      ///< heading of the second panorama minus that of the first, (−π, π]
  double sigma_rad = 0.0;     ///< of turn_rad, if the answer is right at all
  double confidence = 0.0;    ///< 0 … 1: probability that the error is below 3°
  double height = 0.0;        ///< normalised correlation at its peak, −1 … 1, before parallax is fitted
  double rival_height = 0.0;  ///< likewise of the highest other peak
  double match = 0.0;         ///< agreement over all sectors after the fit, 0 … 1 (literal: the height)
  int sectors = 0;            ///< of 16 that have contrast (parallax only)
  double parallax_rad = 0.0;  ///< rms shift that the fit attributes to parallax
};

/// Visual compass (Fernández et al. 2011, §III.B): the turn between two panoramas from the phases of their
/// signatures. Both methods share the cross spectrum and its inverse transform. Deterministic; not thread
/// safe (buffers).
class Compass {
 public:
  /// What the compass needs of one signature. Keep it with a keyframe to prepare it once.
  struct View {
    SignatureFormat format;
    Eigen::ArrayXXcf spectrum;  ///< rows × k2
    double norm = 0.0;          ///< of the spectrum
    ParallaxFit::View bands;
  };

  explicit Compass(const CompassOptions& options = {});

  /// Throws std::invalid_argument if the signature has fewer than k2 phases.
  void prepare(const Signature& signature, View& view) const;
  View prepare(const Signature& signature) const;

  /// Throws std::invalid_argument with whyIncomparable() for different formats.
  CompassResult compare(const View& from, const View& to, const TravelHint& hint = {});
  CompassResult compare(const Signature& from, const Signature& to, const TravelHint& hint = {}) {
    return compare(prepare(from), prepare(to), hint);
  }

 private:
  struct Peak {
    double turn_rad, height;
  };
  void correlate(const View& from, const View& to);
  std::vector<Peak> findPeaks() const;
  Peak refine(int column) const;
  double confidence(const CompassResult& result) const;

  CompassOptions options_;
  ParallaxFit fit_;
  Eigen::ArrayXcf cross_;           ///< cross spectrum, frequencies 1 … k2
  cv::Mat1f packed_, correlation_;  ///< 1 × columns
};

}  // namespace omnifleet::appearance
