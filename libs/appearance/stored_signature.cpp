#include "appearance/stored_signature.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace omnifleet::appearance {
namespace {

constexpr float kLargestByte = 255.0f;
constexpr float kPhaseUnit = static_cast<float>(2.0 * M_PI / 256.0);

}  // namespace

StoredSignature store(const Signature& signature) {
  const SignatureFormat& format = signature.format;
  const Eigen::Index rows = format.stored_rows, modules = format.stored_modules,
                     phases = format.stored_phases,
                     averaged = signature.spectrum.rows() / std::max<Eigen::Index>(rows, 1),
                     kept = std::max(modules, phases);
  StoredSignature stored;
  stored.bytes.reserve(static_cast<std::size_t>(rows * (modules + phases)));
  for (Eigen::Index row = 0; row < rows; ++row) {
    const Eigen::ArrayXcf mean =
        signature.spectrum.block(row * averaged, 0, averaged, kept).colwise().mean().transpose();
    const Eigen::ArrayXf sizes = mean.head(modules).abs();
    const float largest = sizes.maxCoeff(), unit = largest > 0.0f ? kLargestByte / largest : 0.0f;
    stored.scale.push_back(largest);
    for (Eigen::Index k = 0; k < modules; ++k)
      stored.bytes.push_back(static_cast<std::uint8_t>(std::lround(sizes[k] * unit)));
    for (Eigen::Index k = 0; k < phases; ++k)
      stored.bytes.push_back(static_cast<std::uint8_t>(std::lround(std::arg(mean[k]) / kPhaseUnit) & 255));
  }
  return stored;
}

std::string whyMalformed(const SignatureFormat& format, const StoredSignature& stored) {
  const std::size_t rows = format.stored_rows,
                    bytes = rows * (std::size_t{format.stored_modules} + format.stored_phases);
  if (rows == 0 || format.stored_modules == 0) return "the format stores nothing";
  if (stored.bytes.size() != bytes)
    return fmt::format("the signature has {} bytes, its format {}", stored.bytes.size(), bytes);
  if (stored.scale.size() != rows)
    return fmt::format("the signature has {} scales, its format {} rows", stored.scale.size(), rows);
  for (const float scale : stored.scale) {
    if (!std::isfinite(scale) || scale < 0.0f) return "a scale of the signature is not a positive number";
  }
  return "";
}

Signature restore(const SignatureFormat& format, const StoredSignature& stored) {
  if (const std::string reason = whyMalformed(format, stored); !reason.empty())
    throw std::invalid_argument("stored signature: " + reason);
  const Eigen::Index rows = format.stored_rows, modules = format.stored_modules,
                     phases = format.stored_phases;
  Signature signature;
  signature.format = format;
  signature.modules.resize(rows, modules);
  signature.spectrum.setZero(rows, phases);
  signature.weight = Eigen::ArrayXf::Ones(format.columns);
  const std::uint8_t* bytes = stored.bytes.data();
  for (Eigen::Index row = 0; row < rows; ++row) {
    const float unit = stored.scale[static_cast<std::size_t>(row)] / kLargestByte;
    for (Eigen::Index k = 0; k < modules; ++k)
      signature.modules(row, k) = unit * static_cast<float>(*bytes++);
    for (Eigen::Index k = 0; k < phases; ++k, ++bytes) {
      if (k < modules)
        signature.spectrum(row, k) =
            std::polar(signature.modules(row, k), kPhaseUnit * static_cast<float>(*bytes));
    }
  }
  return signature;
}

}  // namespace omnifleet::appearance
