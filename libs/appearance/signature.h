#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "appearance/panorama.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::appearance {

struct SignatureOptions {
  int rows =
      16;        ///< rows of the signature: each is the mean of panorama rows / rows rows; equal: the paper's
  int k1 = 128;  ///< modules per row, of the frequencies 1 … k1
  int k2 = 64;   ///< phases per row
  /// Grey levels: columns that are nowhere brighter, over at least dark_deg, are an occluded sector; 0: none
  /// are.
  double dark_level = 10.0;
  double dark_deg = 4.0;  ///< degrees
  // What is stored of a place; 8 · (128 + 64) + 8 scales are 1568 bytes.
  int stored_rows = 8;
  int stored_modules = 128;
  int stored_phases = 64;
  /// Keys: the names above.
  static SignatureOptions read(const options::Section& section);
};

/// Fourier signature of a panorama (Fernández et al. 2011, §III.A): the discrete Fourier transform of each
/// row, divided by the number of columns, so in grey levels. The mean of a row (frequency 0) is left out: it
/// carries no orientation and changes with the light.
struct Signature {
  SignatureFormat format;
  Eigen::ArrayXXcf spectrum;  ///< rows × max(k1, k2), column k − 1 holds frequency k
  Eigen::ArrayXXf modules;    ///< rows × k1: d of eq. 2
  /// Per column of the panorama 1, or 0 where it shows nothing in any row (own body, outside of the image,
  /// occluded). Such columns are interpolated.
  Eigen::ArrayXf weight;

  /// rows × k2, radians: p of §III.A. @throws std::invalid_argument if k2 exceeds the columns of the spectrum
  Eigen::ArrayXXf phases(int k2) const;
  bool empty() const { return spectrum.size() == 0; }
};

/// Turns panoramas of one unwrapper into signatures. Not thread safe (buffers).
class SignatureMaker {
 public:
  /// Throws options::Error if rows do not divide, or frequencies exceed half of the columns.
  SignatureMaker(const Unwrapper& unwrapper, const SignatureOptions& options);

  /// @param panorama of the unwrapper's size; throws std::invalid_argument otherwise
  /// @param signature overwritten; allocates on the first call only
  void compute(const cv::Mat1b& panorama, Signature& signature);
  Signature compute(const cv::Mat1b& panorama);

  const SignatureFormat& format() const { return format_; }

 private:
  void poolRows(const cv::Mat1b& panorama);
  void findOccluded();
  void interpolate();

  SignatureOptions options_;
  SignatureFormat format_;
  cv::Mat1b valid_;
  std::vector<float> row_share_;         ///< 1 ÷ valid panorama rows of each row; 0: none
  std::vector<std::uint8_t> row_valid_;  ///< per panorama row
  std::vector<float> seen_;              ///< per column 1 or 0, by the table
  std::vector<float> weight_;            ///< per column, of this panorama
  cv::Mat1f pooled_, transformed_;       ///< rows × columns
};

/// Eq. 2: Euclidean distance of the modules. Throws std::invalid_argument with whyIncomparable() for
/// different formats or sizes.
double distance(const Signature& a, const Signature& b);
/// Eq. 2 divided by the mean norm of the two signatures: 0 for equal ones, about 1.4 for unrelated ones.
double difference(const Signature& a, const Signature& b);
/// Likewise, each signature divided by its own norm before: independent of the exposure.
double shapeDifference(const Signature& a, const Signature& b);

/// Empty if signatures of the two formats may be compared. Otherwise the reason: which field and both values.
std::string whyIncomparable(const SignatureFormat& a, const SignatureFormat& b);

}  // namespace omnifleet::appearance
