#include "synthetic/sensor.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "synthetic/value_noise.h"

namespace omnifleet::synthetic {
namespace {

constexpr std::size_t kDeviates = 1U << 16;
constexpr std::size_t kWidestRow = 3U << 13;
constexpr int kSigmaStep = 4 * Sensor::kScale;

float uniform(std::uint32_t i) {
  return (static_cast<float>(hash32(i) >> 8) + 0.5f) / 16777216.0f;
}

/// Normal deviate by Box–Muller.
std::int16_t deviate(std::uint32_t i) {
  const float radius = std::sqrt(-2.0f * std::log(uniform(2 * i + 0x10001)));
  const float value = radius * std::cos(2.0f * static_cast<float>(M_PI) * uniform(2 * i + 0x10002));
  return static_cast<std::int16_t>(std::lround(std::clamp(value, -5.0f, 5.0f) * 256.0f));
}

}  // namespace

Sensor::Sensor(const ImageFormation& image) : image_(image) {
  for (std::uint32_t i = 0; i < kDeviates; ++i) normal_.push_back(deviate(i));
  for (std::size_t i = 0; i < kWidestRow; ++i) normal_.push_back(normal_[i]);
  for (int i = 0; i <= 65536 / kSigmaStep; ++i) {
    const double level = 4.0 * (i + 0.5);
    const double sigma = std::sqrt(image.noise * image.noise + image.shot_noise * image.shot_noise * level);
    sigma_.push_back(static_cast<std::int32_t>(std::lround(sigma * kScale)));
  }
}

void Sensor::develop(const cv::Mat& light, std::uint32_t frame_seed, cv::Mat& bgr) {
  if (image_.blur_px > 0.0) {
    cv::GaussianBlur(light, blurred_, {}, image_.blur_px, image_.blur_px, cv::BORDER_REPLICATE);
  }
  const cv::Mat& seen = image_.blur_px > 0.0 ? blurred_ : light;
  const int values = light.cols * 3;
  for (int v = 0; v < seen.rows; ++v) {
    const auto* in = seen.ptr<std::uint16_t>(v);
    auto* out = bgr.ptr<std::uint8_t>(v);
    const std::int16_t* noise = &normal_[hash32(frame_seed, static_cast<std::uint32_t>(v)) % kDeviates];
    for (int i = 0; i < values; ++i) {
      const int value = in[i];
      const int noisy = value + ((noise[i] * sigma_[static_cast<std::size_t>(value / kSigmaStep)]) >> 8);
      const int level = (noisy + kScale / 2) / kScale;
      out[i] = value == 0 ? 0 : static_cast<std::uint8_t>(std::clamp(level, 0, 255));
    }
  }
}

}  // namespace omnifleet::synthetic
