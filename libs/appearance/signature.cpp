#include "appearance/signature.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace omnifleet::appearance {
namespace {

constexpr float kDegree = static_cast<float>(M_PI / 180.0);

void requireComparable(const Signature& a, const Signature& b) {
  if (const std::string reason = whyIncomparable(a.format, b.format); !reason.empty())
    throw std::invalid_argument("signatures cannot be compared: " + reason);
  if (a.modules.rows() != b.modules.rows() || a.modules.cols() != b.modules.cols())
    throw std::invalid_argument(fmt::format("signatures cannot be compared: {}x{} modules and {}x{} modules",
                                            a.modules.rows(), a.modules.cols(), b.modules.rows(),
                                            b.modules.cols()));
}

template <typename Value>
std::string differ(const char* field, const Value& a, const Value& b) {
  if constexpr (std::is_same_v<Value, float>)
    return a == b ? "" : fmt::format("{} is {:.4f} and {:.4f}", field, a, b);
  else
    return a == b ? "" : fmt::format("{} is {} and {}", field, a, b);
}

}  // namespace

SignatureOptions SignatureOptions::read(const options::Section& section) {
  SignatureOptions o;
  section.read("rows", o.rows, {1, 1024});
  section.read("k1", o.k1, {1, 2048});
  section.read("k2", o.k2, {1, 2048});
  section.read("dark_level", o.dark_level, {0.0, 255.0});
  section.read("dark_deg", o.dark_deg, {0.0, 360.0});
  section.read("stored_rows", o.stored_rows, {1, 1024});
  section.read("stored_modules", o.stored_modules, {1, 2048});
  section.read("stored_phases", o.stored_phases, {0, 2048});
  section.finish();
  return o;
}

Eigen::ArrayXXf Signature::phases(int k2) const {
  if (k2 > spectrum.cols())
    throw std::invalid_argument(
        fmt::format("the signature holds {} phases per row, {} are requested", spectrum.cols(), k2));
  return spectrum.leftCols(k2).arg();
}

SignatureMaker::SignatureMaker(const Unwrapper& unwrapper, const SignatureOptions& options)
    : options_(options), valid_(unwrapper.valid().clone()) {
  const int rows = valid_.rows, columns = valid_.cols;
  if (options.rows < 1 || rows % options.rows != 0 || options.stored_rows < 1 ||
      options.rows % options.stored_rows != 0)
    throw options::Error(fmt::format(
        "signature: rows ({}) must divide the {} rows of the panorama, and stored_rows ({}) must divide rows",
        options.rows, rows, options.stored_rows));
  const int kept = std::max(options.k1, options.k2);
  if (kept > columns / 2 - 1 || options.stored_modules > options.k1 || options.stored_phases > kept)
    throw options::Error(fmt::format(
        "signature: k1 ({}) and k2 ({}) must be below half of the {} columns of the panorama; stored_modules "
        "({}) must not exceed k1, stored_phases ({}) neither k1 nor k2",
        options.k1, options.k2, columns, options.stored_modules, options.stored_phases));
  format_.rows = static_cast<std::uint16_t>(rows);
  format_.columns = static_cast<std::uint16_t>(columns);
  format_.stored_rows = static_cast<std::uint16_t>(options.stored_rows);
  format_.stored_modules = static_cast<std::uint16_t>(options.stored_modules);
  format_.stored_phases = static_cast<std::uint16_t>(options.stored_phases);
  format_.least_elevation_rad = static_cast<float>(unwrapper.leastElevation_rad());
  format_.most_elevation_rad = static_cast<float>(unwrapper.mostElevation_rad());
  format_.camera = unwrapper.camera();

  row_valid_.assign(static_cast<std::size_t>(rows), 0);
  row_share_.assign(static_cast<std::size_t>(options.rows), 0.0f);
  const int per_row = rows / options.rows;
  for (int row = 0; row < rows; ++row) {
    // A row that is mostly interpolated would dilute the others.
    const bool valid = 2 * cv::countNonZero(valid_.row(row)) >= columns;
    row_valid_[static_cast<std::size_t>(row)] = valid;
    if (valid) row_share_[static_cast<std::size_t>(row / per_row)] += 1.0f;
  }
  for (float& share : row_share_) share = share > 0.0f ? 1.0f / share : 0.0f;
  seen_.assign(static_cast<std::size_t>(columns), 0.0f);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column)
      if (row_valid_[static_cast<std::size_t>(row)] && valid_(row, column) != 0)
        seen_[static_cast<std::size_t>(column)] = 1.0f;
  }
}

void SignatureMaker::poolRows(const cv::Mat1b& panorama) {
  const int columns = panorama.cols, per_row = panorama.rows / options_.rows;
  pooled_.create(options_.rows, columns);
  for (int row = 0; row < options_.rows; ++row) {
    float* out = pooled_[row];
    std::fill(out, out + columns, 0.0f);
    for (int k = 0; k < per_row; ++k) {
      const int from = row * per_row + k;
      if (!row_valid_[static_cast<std::size_t>(from)]) continue;
      const std::uint8_t* in = panorama[from];
#pragma GCC ivdep
      for (int c = 0; c < columns; ++c) out[c] += in[c];
    }
    const float share = row_share_[static_cast<std::size_t>(row)];
#pragma GCC ivdep
    for (int c = 0; c < columns; ++c) out[c] *= share;
  }
}

void SignatureMaker::findOccluded() {
  const int columns = pooled_.cols;
  weight_ = seen_;
  const auto dark_level = static_cast<float>(options_.dark_level);
  const int run =
      std::max(1, static_cast<int>(std::lround(options_.dark_deg / 360.0 * static_cast<double>(columns))));
  const auto isDark = [&](int column) {
    for (int row = 0; row < pooled_.rows; ++row)
      if (pooled_(row, column) > dark_level) return false;
    return true;
  };
  // The walk begins behind a bright column, so that no run is cut.
  int first = 0;
  while (first < columns && isDark(first)) ++first;
  for (int k = first, length = 0; k <= first + columns; ++k) {
    const bool dark = k < first + columns && isDark(k % columns);
    if (dark) {
      ++length;
      continue;
    }
    // The columns beside the edge are mixed.
    if (length >= run)
      for (int j = k - length - 1; j <= k; ++j)
        weight_[static_cast<std::size_t>((j + columns) % columns)] = 0.0f;
    length = 0;
  }
  if (first == columns) std::fill(weight_.begin(), weight_.end(), 0.0f);
}

void SignatureMaker::interpolate() {
  const int columns = pooled_.cols;
  const auto gap = [&](int column) { return weight_[static_cast<std::size_t>(column % columns)] == 0.0f; };
  int first = 0;
  while (first < columns && gap(first)) ++first;
  if (first == columns) {
    pooled_.setTo(0.0f);
    return;
  }
  for (int k = first; k < first + columns;) {
    int end = k;
    while (end < first + columns && gap(end)) ++end;
    for (int row = 0; end > k && row < pooled_.rows; ++row) {
      float* line = pooled_[row];
      const float before = line[(k + columns - 1) % columns], after = line[end % columns];
      for (int c = k; c < end; ++c)
        line[c % columns] =
            before + (after - before) * static_cast<float>(c - k + 1) / static_cast<float>(end - k + 1);
    }
    k = std::max(end, k + 1);
  }
}

void SignatureMaker::compute(const cv::Mat1b& panorama, Signature& signature) {
  if (panorama.size() != valid_.size())
    throw std::invalid_argument(fmt::format("signature: the panorama is {}x{}, not {}x{}", panorama.cols,
                                            panorama.rows, valid_.cols, valid_.rows));
  poolRows(panorama);
  if (options_.dark_level > 0.0) {
    findOccluded();
    interpolate();
  } else {
    weight_ = seen_;
  }
  cv::dft(pooled_, transformed_, cv::DFT_ROWS);
  const int kept = std::max(options_.k1, options_.k2);
  const float scale = 1.0f / static_cast<float>(pooled_.cols);
  signature.format = format_;
  signature.spectrum.resize(options_.rows, kept);
  for (int row = 0; row < options_.rows; ++row) {
    const float* packed = transformed_[row];  // Re 0, Re 1, Im 1, Re 2, Im 2, …
    for (int k = 1; k <= kept; ++k)
      signature.spectrum(row, k - 1) = {scale * packed[2 * k - 1], scale * packed[2 * k]};
  }
  const auto part = signature.spectrum.leftCols(options_.k1);
  signature.modules = (part.real().square() + part.imag().square()).sqrt();
  signature.weight = Eigen::Map<const Eigen::ArrayXf>(weight_.data(), pooled_.cols);
}

Signature SignatureMaker::compute(const cv::Mat1b& panorama) {
  Signature signature;
  compute(panorama, signature);
  return signature;
}

double distance(const Signature& a, const Signature& b) {
  requireComparable(a, b);
  return static_cast<double>((a.modules - b.modules).matrix().norm());
}

double difference(const Signature& a, const Signature& b) {
  const double mean = 0.5 * static_cast<double>(a.modules.matrix().norm() + b.modules.matrix().norm());
  return mean > 0.0 ? distance(a, b) / mean : 0.0;
}

double shapeDifference(const Signature& a, const Signature& b) {
  requireComparable(a, b);
  const float norm_a = a.modules.matrix().norm(), norm_b = b.modules.matrix().norm();
  if (!(norm_a > 0.0f && norm_b > 0.0f)) return norm_a == norm_b ? 0.0 : std::sqrt(2.0);
  return static_cast<double>((a.modules / norm_a - b.modules / norm_b).matrix().norm());
}

std::string whyIncomparable(const SignatureFormat& a, const SignatureFormat& b) {
  for (const std::string& reason :
       {differ("camera", a.camera, b.camera), differ("rows of the panorama", a.rows, b.rows),
        differ("columns of the panorama", a.columns, b.columns),
        differ("least elevation (degrees)", a.least_elevation_rad / kDegree, b.least_elevation_rad / kDegree),
        differ("most elevation (degrees)", a.most_elevation_rad / kDegree, b.most_elevation_rad / kDegree),
        differ("stored rows", a.stored_rows, b.stored_rows),
        differ("stored modules", a.stored_modules, b.stored_modules),
        differ("stored phases", a.stored_phases, b.stored_phases)}) {
    if (!reason.empty()) return reason;
  }
  return "";
}

}  // namespace omnifleet::appearance
