#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace omnifleet {

/// Geometry of the panoramas that signatures are computed from, and how they are stored. Signatures are
/// comparable only if all fields are equal.
struct SignatureFormat {
  std::uint16_t rows = 0, columns = 0;  ///< of the panorama
  std::uint16_t stored_rows = 0;        ///< each is the mean of rows / stored_rows rows of the panorama
  std::uint16_t stored_modules = 0;     ///< per stored row, of the frequencies 1 … stored_modules
  std::uint16_t stored_phases = 0;      ///< likewise
  float least_elevation_rad = 0.0f, most_elevation_rad = 0.0f;  ///< edges of the band above the horizon
  std::string camera;  ///< projection and size of the image, e.g. "equidistant 1280x960"

  bool operator==(const SignatureFormat& o) const {
    return rows == o.rows && columns == o.columns && stored_rows == o.stored_rows &&
           stored_modules == o.stored_modules && stored_phases == o.stored_phases &&
           least_elevation_rad == o.least_elevation_rad && most_elevation_rad == o.most_elevation_rad &&
           camera == o.camera;
  }
  bool operator!=(const SignatureFormat& o) const { return !(*this == o); }
};

/// A Fourier signature (Fernández et al. 2011 §III.A) as it is stored: per stored row the magnitudes in units
/// of 1/255 of the row's largest one, then the phases in units of 2π/256.
struct StoredSignature {
  std::vector<std::uint8_t> bytes;
  std::vector<float> scale;  ///< largest magnitude of each stored row
};

/// The panorama of one frame compared with that of an earlier frame.
struct Appearance {
  std::int64_t since_ns = 0;    ///< frame that turn and difference refer to; 0: there is none
  double turn_rad = 0.0;        ///< visual compass: heading minus that at since_ns
  double turn_sigma_rad = 0.0;  ///< ≤ 0: the compass gives no answer
  float confidence = 0.0f;      ///< of the compass, 0 … 1
  float difference = 0.0f;      ///< distance of the signatures (eq. 2), divided by their mean norm
  SignatureFormat format;
  StoredSignature signature;  ///< of a place; empty: the frame is none
};

}  // namespace omnifleet
