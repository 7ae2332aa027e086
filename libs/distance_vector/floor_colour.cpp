#include "distance_vector/floor_colour.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace omnifleet::distance_vector {
namespace {

constexpr int kBins = 40;                           // of each chroma, 0 to 2/3 of the sum of the channels
constexpr int kLevelBins = 64;                      // of the level, 0 to 442 (white)
constexpr int kStep_px = 2;                         // every second pixel of every second row
constexpr double kMinShare = 0.12;                  // of the strip's weight: fewer pixels are no candidate
constexpr float kNear = 0.75f, kFar = 1.33f;        // range of the level around a mode
constexpr float kDark = 6.0f;                       // level below which a pixel has no hue
constexpr int kBlock_px = 16;                       // side of the blocks whose inner variation is measured
constexpr int kBlockColumns = 128, kBlockRows = 8;  // the strip of an image of 2048×1024 px
constexpr float kToSigma = 1.4826f;                 // median absolute deviation → σ
constexpr float kRayleigh = 1.1774f;  // median of the length of a two-dimensional normal deviate ÷ σ
constexpr double kMemoryRate = 0.1;

float median(std::vector<float>& values) {
  if (values.empty()) return 0.0f;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

int chromaBin(float channel, float sum) {
  return std::clamp(static_cast<int>(channel / sum * 1.5f * kBins), 0, kBins - 1);
}

}  // namespace

void FloorColour::readStrip(const SmoothedImage& image) {
  const int width = image.size().width, height = image.size().height;
  const int rows = std::max(4, static_cast<int>(options_.seed_rows * height));
  strip_.clear();
  for (int v = height - rows; v < height; v += kStep_px) {
    for (int u = 1; u < width - 1; u += kStep_px) {
      const cv::Vec3f colour = image.colour(u, v);
      const auto level = static_cast<float>(cv::norm(colour));
      const bool middle = u >= width / 4 && u < width - width / 4;
      strip_.push_back({colour, level, u, v, middle ? 3.0f : 1.0f});
    }
  }
  taken_.assign(strip_.size(), 0);
}

float FloorColour::limit(const FloorSample& sample) const {
  return std::max(static_cast<float>(options_.min_chroma),
                  static_cast<float>(options_.sigmas) * sample.across);
}

bool FloorColour::agrees(const FloorSample& sample, const Pixel& pixel) const {
  return pixel.level > kNear * sample.level && pixel.level < kFar * sample.level &&
         sample.distance(pixel.colour) < limit(sample);
}

/// The most frequent hue, and of its pixels the most frequent level.
std::optional<FloorSample> FloorColour::mode() {
  histogram_.assign(kBins * kBins, 0.0f);
  double total = 0.0;
  for (std::size_t i = 0; i < strip_.size(); ++i) {
    const Pixel& p = strip_[i];
    total += static_cast<double>(p.weight);
    if (taken_[i] || p.level < kDark) continue;
    const float sum = p.colour[0] + p.colour[1] + p.colour[2];
    histogram_[static_cast<std::size_t>(chromaBin(p.colour[0], sum) * kBins + chromaBin(p.colour[2], sum))] +=
        p.weight;
  }
  float best = 0.0f;
  int blue = 0, red = 0;
  for (int b = 1; b < kBins - 1; ++b) {
    for (int r = 1; r < kBins - 1; ++r) {
      float sum = 0.0f;
      for (int i = b - 1; i <= b + 1; ++i)
        for (int j = r - 1; j <= r + 1; ++j) sum += histogram_[static_cast<std::size_t>(i * kBins + j)];
      if (sum <= best) continue;
      best = sum;
      blue = b;
      red = r;
    }
  }
  if (static_cast<double>(best) < kMinShare * total) return std::nullopt;
  levels_.assign(kLevelBins, 0.0f);
  const auto inHue = [&](std::size_t i) {
    const Pixel& p = strip_[i];
    if (taken_[i] || p.level < kDark) return false;
    const float sum = p.colour[0] + p.colour[1] + p.colour[2];
    return std::abs(chromaBin(p.colour[0], sum) - blue) <= 1 &&
           std::abs(chromaBin(p.colour[2], sum) - red) <= 1;
  };
  for (std::size_t i = 0; i < strip_.size(); ++i)
    if (inHue(i))
      levels_[static_cast<std::size_t>(std::min(kLevelBins - 1, static_cast<int>(strip_[i].level / 7.0f)))] +=
          strip_[i].weight;
  int level_bin = 0;
  best = 0.0f;
  for (int k = 0; k < kLevelBins; ++k) {
    float sum = 0.0f;
    const int from = static_cast<int>(kNear * static_cast<float>(k)),
              to = std::min(kLevelBins - 1, static_cast<int>(kFar * static_cast<float>(k)) + 1);
    for (int i = from; i <= to; ++i) sum += levels_[static_cast<std::size_t>(i)];
    // On an even floor many intervals hold all pixels; the one around them is meant.
    const bool is_fuller =
        levels_[static_cast<std::size_t>(k)] > levels_[static_cast<std::size_t>(level_bin)];
    if (sum < best || (sum == best && !is_fuller)) continue;
    best = sum;
    level_bin = k;
  }
  FloorSample sample;
  sample.level = 7.0f * (static_cast<float>(level_bin) + 0.5f);
  cv::Vec3f mean(0, 0, 0);
  for (std::size_t i = 0; i < strip_.size(); ++i) {
    const Pixel& p = strip_[i];
    if (inHue(i) && p.level > kNear * sample.level && p.level < kFar * sample.level)
      mean += p.colour * p.weight;
  }
  const double length = cv::norm(mean);
  if (!(length > 0.0)) return std::nullopt;
  sample.direction = mean * static_cast<float>(1.0 / length);
  sample.across = 0.0f;
  return refined(sample);
}

/// Mean, variation and place of the pixels that agree. Marks them as taken.
std::optional<FloorSample> FloorColour::refined(FloorSample sample) {
  double share = 0.0, total = 0.0;
  for (int round = 0; round < 2; ++round) {
    cv::Vec3f mean(0, 0, 0);
    float weight = 0.0f;
    total = 0.0;
    differences_.clear();
    for (std::size_t i = 0; i < strip_.size(); ++i) {
      const Pixel& p = strip_[i];
      total += static_cast<double>(p.weight);
      if (taken_[i] || !agrees(sample, p)) continue;
      mean += p.colour * p.weight;
      weight += p.weight;
      differences_.push_back(sample.distance(p.colour));
    }
    share = static_cast<double>(weight) / total;
    if (share < kMinShare) return std::nullopt;
    sample.across = median(differences_) / kRayleigh;
    sample.level = static_cast<float>(cv::norm(mean)) / weight;
    sample.direction = mean * static_cast<float>(1.0 / cv::norm(mean));
  }
  // Variation of the level within blocks, so that light that falls off slowly does not count.
  struct Block {
    float sum = 0.0f;
    int n = 0;
  };
  std::array<Block, kBlockColumns * kBlockRows> blocks{};
  const auto blockOf = [&](const Pixel& p) -> Block& {
    const int column = std::min(p.u / kBlock_px, kBlockColumns - 1), row = (p.v / kBlock_px) % kBlockRows;
    return blocks[static_cast<std::size_t>(column + kBlockColumns * row)];
  };
  differences_.clear();
  double column = 0.0, counted = 0.0;
  for (std::size_t i = 0; i < strip_.size(); ++i) {
    const Pixel& p = strip_[i];
    if (taken_[i] || !agrees(sample, p)) continue;
    blockOf(p).sum += p.colour.dot(sample.direction);
    ++blockOf(p).n;
    column += static_cast<double>(p.weight) * p.u;
    counted += static_cast<double>(p.weight);
  }
  for (std::size_t i = 0; i < strip_.size(); ++i) {
    const Pixel& p = strip_[i];
    if (taken_[i] || !agrees(sample, p)) continue;
    const Block& block = blockOf(p);
    differences_.push_back(
        std::abs(p.colour.dot(sample.direction) - block.sum / static_cast<float>(block.n)));
    taken_[i] = 1;
  }
  sample.along = kToSigma * median(differences_);
  sample.column = static_cast<int>(column / counted);
  return sample;
}

const std::vector<FloorSample>& FloorColour::find(const SmoothedImage& image) {
  constexpr std::size_t kMost = 3;
  readStrip(image);
  found_.clear();
  found_.reserve(kMost);
  remembered_share_ = 0.0;
  if (memory_) {
    double agreeing = 0.0, total = 0.0;
    FloorSample wide = *memory_;
    for (const Pixel& p : strip_) {
      total += static_cast<double>(p.weight);
      if (agrees(wide, p)) agreeing += static_cast<double>(p.weight);
    }
    remembered_share_ = total > 0.0 ? agreeing / total : 0.0;
    if (auto sample = refined(*memory_)) {
      sample->remembered = true;
      found_.push_back(*sample);
    }
  }
  while (found_.size() < kMost) {
    auto sample = mode();
    if (!sample) break;
    sample->remembered = memory_ && memory_->distance(sample->direction * sample->level) < limit(*memory_);
    found_.push_back(*sample);
  }
  return found_;
}

void FloorColour::remember(const FloorSample& sample) {
  if (!memory_ || !sample.remembered) {
    memory_ = sample;
    return;
  }
  const auto rate = static_cast<float>(kMemoryRate);
  memory_->direction = memory_->direction * (1.0f - rate) + sample.direction * rate;
  memory_->direction *= static_cast<float>(1.0 / cv::norm(memory_->direction));
  memory_->level += rate * (sample.level - memory_->level);
  memory_->across += rate * (sample.across - memory_->across);
  memory_->along += rate * (sample.along - memory_->along);
}

}  // namespace omnifleet::distance_vector
