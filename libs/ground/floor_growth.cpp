#include "ground/floor_growth.h"

#include <algorithm>
#include <cmath>

#include "geometry/lanes.h"

namespace omnifleet::ground {

namespace {

// Gains of the filter that follows the floor's brightness from block to block: a steady slope is followed
// without lag (an α–β filter along the way of growth), the noise of a block's mean is halved.
constexpr float kLevelGain = 0.5f, kSlopeGain = 0.1f;
// Where a block differs in hue by more than half the tolerance, or something beyond the floor is near it in
// colour, hue adapts more slowly: else a few blocks that are mixed of both, or chance, would turn one into
// the other.
constexpr float kDoubtful2 = 0.25f;  // of the squared tolerance
constexpr float kNear = 8.0f;        // tolerances
constexpr float kHueGain = 0.1f;
constexpr float kTextureSigmas =
    2.0f;                             // of the floor's own texture, added to the step that counts as an edge
constexpr float kSeedLevel = 160.0f;  // grey level that darker floors are brightened to for their histogram
constexpr float kMostOthers = 0.25f;  // of the seeds; where more differ in hue the floor has several
constexpr float kMaxSlope = 0.15f;    // of the brightness, per block
constexpr float kFalls = 0.02f;       // as kMaxSlope: what noise and grain make up is no light that falls
// In hues that are smoothed an edge is a slope over so many blocks to each side, which growth would follow.
constexpr int kBeside = 2;
constexpr const int (&kStepX)[FarFloor::kSteps] = FarFloor::kStepX,
                    (&kStepY)[FarFloor::kSteps] = FarFloor::kStepY;

using lanes::FourFloats;  // a colour, and what comes behind it

OMNIFLEET_INLINE float dot(const FourFloats& a, const FourFloats& b) {
  const FourFloats products = a * b;
  return products[0] + products[1] + products[2];
}

OMNIFLEET_WIDE void takeGreens(const float* __restrict means, const std::uint8_t* __restrict stops, int count,
                               std::uint8_t grown, float* __restrict greens) {
  for (int i = 0; i < count; ++i) greens[i] = stops[i] == grown ? means[3 * i + 1] : 0.0f;
}

/// |after − before − change · colour|²: what a slope of brightness leaves of the step over two blocks.
OMNIFLEET_INLINE float leftOfStep(const float* after, const float* before, float change,
                                  const FourFloats& colour) {
  const FourFloats left = lanes::load<FourFloats>(after) - lanes::load<FourFloats>(before) - change * colour;
  return dot(left, left);
}

/// Squared, what of the step between two colours is not brightness; as a share of |colour|².
OMNIFLEET_INLINE float hueStep(const float* after, const float* before, const FourFloats& colour,
                               float share_of_rr) {
  const FourFloats step = lanes::load<FourFloats>(after) - lanes::load<FourFloats>(before);
  const float along = dot(step, colour) * share_of_rr;
  return dot(step, step) * share_of_rr - along * along;
}

/// Bit k: growth may go on in the direction of step k. One look at all, as a branch for each costs more.
OMNIFLEET_INLINE unsigned openSteps(const std::uint8_t* at, std::ptrdiff_t row_step) {
  const std::uint8_t *above = at - row_step, *below = at + row_step;
  const unsigned closed = (at[1] & 1u) | (below[0] & 1u) << 1 | (at[-1] & 1u) << 2 | (above[0] & 1u) << 3 |
                          (below[1] & 1u) << 4 | (below[-1] & 1u) << 5 | (above[-1] & 1u) << 6 |
                          (above[1] & 1u) << 7;
  return closed ^ 255u;
}

/// What a colour may be off by, as shares of |r|.
struct Off {
  float along, across;
  OMNIFLEET_INLINE FloorTest test() const { return {along * along, across * across}; }
};

/// @param rr |r|²
OMNIFLEET_INLINE Off toleratedAt(float rr, const FloorTolerance& tolerance, const FloorNoise& noise) {
  const float per_level = static_cast<float>(tolerance.noise_sigmas) / std::sqrt(rr);
  return {static_cast<float>(tolerance.along) + static_cast<float>(noise.channel) * per_level,
          static_cast<float>(tolerance.across) + static_cast<float>(noise.hue) * per_level};
}

float medianOf(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

FloorTest FloorTolerance::testFor(const cv::Vec3f& r, const FloorNoise& noise) const {
  return toleratedAt(std::max(1.0f, r.dot(r)), *this, noise).test();
}

FloorGrowth::FloorGrowth(const cv::Mat1b& coverage, const cv::Mat1b& seeds, const FloorTolerance& tolerance,
                         double min_share, bool all_modes)
    : tolerance_(tolerance),
      min_share_(min_share),
      all_modes_(all_modes),
      stride_(coverage.cols + 2 * kJump),
      closed_(coverage.rows + 2 * kJump, stride_, kClosed),
      framed_means_(closed_.size(), cv::Vec3f(0, 0, 0)),
      means_(framed_means_(cv::Rect(kJump, kJump, coverage.cols, coverage.rows))),
      far_(closed_.total()),
      handed_(closed_.total()),
      light_(closed_.size(), 1.0f) {
  for (int y = 0; y < coverage.rows; ++y) {
    for (int x = 0; x < coverage.cols; ++x) {
      // Whether the outermost are flat cannot be told.
      const bool inner = x > 0 && y > 0 && x + 1 < coverage.cols && y + 1 < coverage.rows;
      if (inner && coverage(y, x) == 2) closed_(y + kJump, x + kJump) = 0;
      if (seeds(y, x) != 0) seeds_.push_back((y + kJump) * stride_ + x + kJump);
    }
  }
  queue_.resize(coverage.total());  // all its memory is touched before the first frame
}

cv::Mat3f& FloorGrowth::means() {
  if (is_evened_) light_ = 1.0f;
  is_evened_ = false;
  return means_;
}

void FloorGrowth::evenOut(const cv::Mat1f& light) {
  is_evened_ = true;
  for (int y = 0; y < means_.rows; ++y) {
    auto* mean = means_.ptr<cv::Vec3f>(y);
    float* before = light_.ptr<float>(y + kJump) + kJump;
    const float* now = light.ptr<float>(y);
    for (int x = 0; x < means_.cols; ++x) {
      mean[x] *= before[x] / now[x];
      before[x] = now[x];
    }
  }
}

void FloorGrowth::levels(std::vector<float>& by_number) const {
  by_number.resize(static_cast<std::size_t>(numbers()));
  takeGreens(meansByNumber(), stop_.data, numbers(), kGrown, by_number.data());
}

float FloorGrowth::brightnessAt(int number) const {
  const float* mean = framed_means_.ptr<float>() + 3 * number;
  return (mean[0] + mean[1] + mean[2]) * lightAt(number);
}

bool FloorGrowth::seed(const FloorNoise& noise) {
  if (seeds_.empty()) return false;  // a ring that is thinner than a block
  const auto* means = framed_means_.ptr<cv::Vec3f>();
  // The bins are as wide in the dark as the differences of brightness there are small: without this, things
  // in the ring and the floor would fill bins that touch.
  const float gain = brighten();
  const auto binAt = [gain](const cv::Vec3f& c) {
    return GroundHistogram::binOf(cv::saturate_cast<std::uint8_t>(gain * c[0]),
                                  cv::saturate_cast<std::uint8_t>(gain * c[1]),
                                  cv::saturate_cast<std::uint8_t>(gain * c[2]));
  };
  histogram_.clear();
  for (const int block : seeds_) histogram_.add(binAt(means[block]));
  if (histogram_.settle(min_share_, 0, all_modes_) <= 0.0) return false;
  closed_.copyTo(stop_);
  queue_.clear();
  for (const int block : seeds_) {
    if (histogram_.table()[binAt(means[block])] == 0) continue;
    const cv::Vec3f& mean = means[block];
    stop_.data[block] = kGrown;
    handed_[static_cast<std::size_t>(block)] = {{mean[0], mean[1], mean[2], 0.0f}, {0.0f, 0.0f}};
    queue_.push_back(block);
  }
  if (!all_modes_) dropOtherHues(noise);
  dropBeyond();
  texture_ = seedTexture();
  return !queue_.empty();
}

/// Things in the ring whose colours lie beside the floor's fill bins that touch its: the histogram cannot
/// tell them, the hue can.
void FloorGrowth::dropOtherHues(const FloorNoise& noise) {
  if (queue_.empty()) return;
  const float* means = framed_means_.ptr<float>();
  FourFloats mean{};
  for (const int block : queue_) mean += lanes::load<FourFloats>(means + 3 * block);
  mean /= static_cast<float>(queue_.size());
  const float rr = std::max(1.0f, dot(mean, mean)),
              across2 = toleratedAt(rr, tolerance_, noise).test().across2;
  const auto isOther = [&](int block) {
    const auto colour = lanes::load<FourFloats>(means + 3 * block);
    const float gain = dot(colour, mean) / rr;
    return dot(colour, colour) / rr - gain * gain > across2 * gain * gain;
  };
  const auto others = std::count_if(queue_.begin(), queue_.end(), isOther);
  if (static_cast<float>(others) > kMostOthers * static_cast<float>(queue_.size())) return;
  for (const int block : queue_)
    if (isOther(block)) stop_.data[block] = closed_.data[block];
  queue_.erase(std::remove_if(queue_.begin(), queue_.end(), isOther), queue_.end());
}

/// Near a wall the ring of the seeds holds some of it. What is beyond and far from all seeds in colour is not
/// asked about any more.
void FloorGrowth::dropBeyond() {
  if (beyond_.empty()) return;
  const float* means = framed_means_.ptr<float>();
  const auto meanOf = [means](int block) { return lanes::load<FourFloats>(means + 3 * block); };
  const auto meanOfSeeds = [&] {
    FourFloats sum{};
    for (const int block : queue_) sum += meanOf(block);
    lanes::store(sum / static_cast<float>(queue_.size()), &of_seeds_);
    return lanes::load<FourFloats>(&of_seeds_);
  };
  const FourFloats seeds = meanOfSeeds();
  bool any_near = false;
  for (cv::Vec4f& colour : beyond_) {
    const FloorTest apart = offOf(lanes::load<FourFloats>(&colour), seeds);
    if (apart.along2 + apart.across2 > kNear * kNear) colour[0] = -1.0f;
    any_near = any_near || colour[0] >= 0.0f;
  }
  if (!any_near) {
    beyond_.clear();
    return;
  }
  const auto isBeyond = [&](int block) {
    if (hueGain(block, meanOf(block), seeds) >= 0.0f) return false;
    stop_.data[block] = closed_.data[block];
    return true;
  };
  queue_.erase(std::remove_if(queue_.begin(), queue_.end(), isBeyond), queue_.end());
  if (!queue_.empty()) meanOfSeeds();
}

/// What makes the middle one of the seeds as bright as kSeedLevel; never darker than the camera saw it. (In
/// even light it may be brighter than any level.)
float FloorGrowth::brighten() {
  sorted_.clear();
  const auto* means = framed_means_.ptr<cv::Vec3f>();
  for (const int block : seeds_)
    sorted_.push_back(std::max({means[block][0], means[block][1], means[block][2]}));
  return std::max(is_evened_ ? 0.0f : 1.0f, kSeedLevel / std::max(1.0f, medianOf(sorted_)));
}

float FloorGrowth::seedTexture() {
  sorted_.clear();
  const auto* means = framed_means_.ptr<cv::Vec3f>();
  for (const int block : queue_) {
    if (stop_.data[block + 2] != kGrown) continue;
    const cv::Vec3f step = means[block + 2] - means[block];
    sorted_.push_back(std::sqrt(step.dot(step) / std::max(1.0f, means[block].dot(means[block]))));
  }
  return sorted_.empty() ? 0.0f : medianOf(sorted_);
}

void FloorGrowth::lookBeyond(const cv::Mat1b& sectors) {
  sector_ = cv::Mat1b(closed_.size(), std::uint8_t{0});
  sectors.copyTo(sector_(cv::Rect(kJump, kJump, sectors.cols, sectors.rows)));
}

void FloorGrowth::lookFar(const FarFloor& far) {
  for (int y = 0; y < means_.rows; ++y)
    for (int x = 0; x < means_.cols; ++x)
      far_[static_cast<std::size_t>(numberOf(y, x))] = far[y * means_.cols + x];
}

OMNIFLEET_INLINE FloorGrowth::Handed FloorGrowth::steepened(const Handed& from, float by) {
  Handed steeper = from;
  for (float& slope : steeper.slope) slope = std::clamp(by * slope, -kMaxSlope, kMaxSlope);
  return steeper;
}

/// Squared differences of p from r in multiples of the tolerances.
template <typename Colour>
OMNIFLEET_INLINE FloorTest FloorGrowth::offOf(const Colour& p, const Colour& r) const {
  const auto along = static_cast<float>(tolerance_.along), across = static_cast<float>(tolerance_.across);
  const float share = 1.0f / dot(r, r), gain = dot(p, r) * share, darker = (gain - 1.0f) / along;
  return {darker * darker, (dot(p, p) * share - gain * gain) / (across * across)};
}

/// By how much of a block's difference in hue that is adapted which it hands on; negative where it is of what
/// is beyond. What is textured differs from itself in brightness, less in hue: where that tells, it alone is
/// asked, against the seeds, so that no chain of likenesses leads from one to the other.
template <typename Colour>
OMNIFLEET_INLINE float FloorGrowth::hueGain(int at, const Colour& mean, const Colour& expected) const {
  auto beyond = lanes::load<FourFloats>(&beyond_[sector_.data[at]]);
  if (!(beyond[0] >= 0.0f)) return kLevelGain;
  if (is_evened_) beyond /= lightAt(at);  // as the means
  const auto seeds = lanes::load<FourFloats>(&of_seeds_);
  const FloorTest apart = offOf(beyond, expected), hues = offOf(beyond, seeds);
  if (apart.along2 + hues.across2 > kNear * kNear) return kLevelGain;
  const FloorTest to = offOf(mean, beyond);
  if (hues.across2 > 1.0f) return to.across2 < offOf(mean, seeds).across2 ? -1.0f : kHueGain;
  const FloorTest from = offOf(mean, expected);
  const bool is_beyond = apart.along2 > 1.0f && to.along2 + to.across2 < from.along2 + from.across2;
  return is_beyond ? -1.0f : kHueGain;
}

/// Where no floor can be seen there is nothing to compare with.
template <typename Colour>
OMNIFLEET_INLINE bool FloorGrowth::isAtHuesEdge(int at, const Colour& colour, float across2) const {
  const float* mean = meansByNumber() + 3 * at;
  const float share_of_rr = 1.0f / dot(colour, colour);
  const auto changes = [&](int beside) __attribute__((always_inline)) {
    if (((closed_.data[at - beside] | closed_.data[at + beside]) & kClosed) != 0) return false;
    return hueStep(mean + 3 * beside, mean - 3 * beside, colour, share_of_rr) > across2;
  };
  return changes(kBeside) || changes(kBeside * stride_);
}

/// Takes a block in when it is like the floor expected there and no edge runs through it: its neighbours on
/// both sides differ by no more than the slope explains. Without the latter the growth would climb onto
/// objects over the blocks that their edges cut by and by.
template <bool kSmoothed>
OMNIFLEET_INLINE bool FloorGrowth::accept(int to, const Handed& from, const FloorTest& test, float flatness,
                                          int step, int jump) {
  const float* at = framed_means_.ptr<float>() + 3 * to;
  const auto mean = lanes::load<FourFloats>(at);
  const auto dx = static_cast<float>(kStepX[step] * jump), dy = static_cast<float>(kStepY[step] * jump);
  const float change = from.slope[0] * dx + from.slope[1] * dy;
  const FourFloats expected =
      (1.0f + std::clamp(change, -kMaxSlope, kMaxSlope)) * lanes::load<FourFloats>(from.colour);
  const float share_of_rr = 1.0f / dot(expected, expected), gain = dot(mean, expected) * share_of_rr,
              surprise = gain - 1.0f;
  if (!(surprise * surprise <= test.along2)) return false;
  const float across2 = dot(mean, mean) * share_of_rr - gain * gain;
  if (!(across2 <= test.across2)) return false;
  if constexpr (kSmoothed)
    if (isAtHuesEdge(to, expected, test.across2)) return false;
  const float allowed = flatness * flatness / share_of_rr;
  const std::ptrdiff_t below = 3 * stride_;
  if (!(leftOfStep(at + 3, at - 3, 2.0f * from.slope[0], expected) <= allowed)) return false;
  if (!(leftOfStep(at + below, at - below, 2.0f * from.slope[1], expected) <= allowed)) return false;
  const float beside_beyond = beyond_.empty() ? kLevelGain : hueGain(to, mean, expected);
  if (beside_beyond < 0.0f) return false;
  const float hue_gain = kSmoothed || across2 > kDoubtful2 * test.across2 ? kHueGain : beside_beyond;
  stop_.data[to] = kGrown;
  Handed& handed = handed_[static_cast<std::size_t>(to)];
  const float level = 1.0f + (kLevelGain - hue_gain) * surprise;
  lanes::store((level - hue_gain) * expected + hue_gain * mean, handed.colour);
  const float share = 1.0f / (dx * dx + dy * dy), steeper = kSlopeGain * surprise;
  handed.slope[0] = from.slope[0] + steeper * (dx * share);
  handed.slope[1] = from.slope[1] + steeper * (dy * share);
  queue_.push_back(to);
  return true;
}

template <bool kSmoothed>
OMNIFLEET_INLINE void FloorGrowth::growFrom(int at, const FloorNoise& noise) {
  const std::uint8_t* stop = stop_.data;
  unsigned open = openSteps(stop + at, stride_);
  if (open == 0) return;
  const FarFloor::Block& far = far_[static_cast<std::size_t>(at)];
  const Handed from = handed_[static_cast<std::size_t>(at)], falling = steepened(from, far.steepening);
  const auto colour = lanes::load<FourFloats>(from.colour);
  const float light = lightAt(at);
  const Off tolerated = toleratedAt(std::max(1.0f, dot(colour, colour) * light * light), tolerance_, noise);
  const FloorTest test = tolerated.test();
  // The texture measured holds the noise.
  const float flatness =
      std::max(tolerated.along, static_cast<float>(tolerance_.along) + kTextureSigmas * texture_);
  for (; open != 0; open &= open - 1) {
    const int step = __builtin_ctz(open);
    const int offset = kStepY[step] * stride_ + kStepX[step];
    const float change =
        from.slope[0] * static_cast<float>(kStepX[step]) + from.slope[1] * static_cast<float>(kStepY[step]);
    const Handed& handed = (far.outward >> step & 1u) != 0 && change < -kFalls ? falling : from;
    for (int jump = 1, to = at + offset; jump <= kJump && stop[to] == 0; ++jump, to += offset)
      if (accept<kSmoothed>(to, handed, test, flatness, step, jump)) break;
  }
}

bool FloorGrowth::grow(const FloorNoise& noise, const std::vector<cv::Vec4f>& beyond, bool is_smoothed) {
  beyond_.clear();
  if (!sector_.empty()) beyond_.assign(beyond.begin(), beyond.end());
  if (!seed(noise)) return false;
  if (is_smoothed) {
    handMeanHueOn(noise);
    growBySmoothedHues(noise);
  } else {
    growByMeans(noise);
  }
  return !queue_.empty();
}

/// Of all seeds, instead of each one's own; but none of those that lie on a thing's edge.
void FloorGrowth::handMeanHueOn(const FloorNoise& noise) {
  const float* means = meansByNumber();
  FourFloats sum{};
  for (const int block : queue_) sum += lanes::load<FourFloats>(means + 3 * block);
  const float rr = dot(sum, sum);
  std::size_t kept = 0;
  for (const int block : queue_) {
    const FourFloats colour = dot(lanes::load<FourFloats>(means + 3 * block), sum) / rr * sum;
    const FloorTest test = toleratedAt(std::max(1.0f, dot(colour, colour)), tolerance_, noise).test();
    if (isAtHuesEdge(block, colour, test.across2)) {
      stop_.data[block] = closed_.data[block];
      continue;
    }
    lanes::store(colour, handed_[static_cast<std::size_t>(block)].colour);
    queue_[kept++] = block;
  }
  queue_.resize(kept);
}

OMNIFLEET_WIDE void FloorGrowth::growByMeans(const FloorNoise& noise) {
  growAll<false>(noise);
}

OMNIFLEET_WIDE void FloorGrowth::growBySmoothedHues(const FloorNoise& noise) {
  growAll<true>(noise);
}

template <bool kSmoothed>
OMNIFLEET_INLINE void FloorGrowth::growAll(const FloorNoise& noise) {
  // Most blocks are shut in when their turn comes. These are sorted out by counting, many at a time: a branch
  // for each would be mispredicted. Who is shut in stays so.
  constexpr std::size_t kMany = 64;
  int open[kMany];
  for (std::size_t next = 0; next < queue_.size();) {
    const std::size_t end = std::min(next + kMany, queue_.size());
    std::size_t count = 0;
    for (; next < end; ++next) {
      const int at = queue_[next];
      __builtin_prefetch(&far_[static_cast<std::size_t>(at)]);
      open[count] = at;
      count += openSteps(stop_.data + at, stride_) != 0 ? 1 : 0;
    }
    for (std::size_t k = 0; k < count; ++k) growFrom<kSmoothed>(open[k], noise);
  }
}

}  // namespace omnifleet::ground
