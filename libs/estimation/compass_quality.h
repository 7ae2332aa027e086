#pragma once

#include "options/options.h"

namespace omnifleet::estimation {

struct CompassQualityOptions {
  double memory_steps = 30.0;  ///< turns that the moments reach back
  double prior_steps = 5.0;    ///< weight of the prior that the compass is as good as its σ
  double most_rad = 0.5;       ///< rad; a larger difference is a wrong reference, not an error of the compass
  static CompassQualityOptions read(const options::Section& section);
};

/// How good the visual compass of one robot is, estimated from its turns beside those of a reference: of scan
/// matches or, where there are none, of the wheels (innovation-based, Mehra 1970). Near walls and few objects
/// its errors exceed its σ and go one way from frame to frame. So the variance is that of the sum of the
/// errors over the memory, divided by their number, if it is the larger one (the long-run variance of a
/// correlated sequence; Newey and West 1987 with one block).
class CompassQuality {
 public:
  explicit CompassQuality(const CompassQualityOptions& options = {}) : options_(options) {}

  /// What the compass is compared with.
  struct Reference {
    double sigma_rad = 0.0;   ///< of the turn
    bool correlated = false;  ///< errors may go one way from turn to turn, as those of wheels
  };

  /// @param error_rad turn of the compass less that of the reference @param sigma_rad of the compass, as it
  /// claims, > 0
  void add(double error_rad, double sigma_rad, const Reference& reference);

  /// σ of a turn, in units of what the compass claims; ≥ 1.
  double scale() const { return scale_; }

 private:
  CompassQualityOptions options_;
  double steps_ = 0.0;                           ///< weight of the sums
  double errors_ = 0.0, squares_ = 0.0;          ///< of errors and their squares, in σ
  double correlated_ = 0.0;                      ///< likewise of σ of correlated references
  double references_ = 0.0, references2_ = 0.0;  ///< of the variances of all references and their squares
  double scale_ = 1.0;
};

}  // namespace omnifleet::estimation
