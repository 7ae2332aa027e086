#include "ground/region_growing.h"

#include <algorithm>
#include <cmath>

#include "geometry/lanes.h"

namespace omnifleet::ground {

namespace {

// Gains of the filter that follows the floor's brightness from block to block, an α–β filter in the direction
// of growing. It follows a constant gradient without lag and halves the noise of a block's mean.
constexpr float kLevelGain = 0.5f, kSlopeGain = 0.1f;
// Hue adapts more slowly where a block differs in hue by more than half the tolerance, or where something
// beyond the floor has a similar colour. Otherwise a few mixed blocks, or chance, would turn one hue into the
// other.
constexpr float kDoubtful2 = 0.25f;  // share of the squared tolerance
constexpr float kNear = 8.0f;        // tolerances
constexpr float kHueGain = 0.1f;
constexpr float kTextureSigmas =
    2.0f;  // multiple of the floor's own texture that is added to the edge threshold
constexpr float kSeedLevel = 160.0f;  // grey level to which darker floors are brightened for their histogram
constexpr float kMostOthers = 0.25f;  // share of the seeds; if more differ in hue, the floor has several hues
constexpr float kMaxSlope = 0.15f;    // share of the brightness, per block
constexpr float kFalls = 0.02f;  // like kMaxSlope; a smaller decrease is noise or texture, not falling light
// In smoothed hues an edge is a gradient over this many blocks to each side, which growing would follow.
constexpr int kBeside = 2;
constexpr const int (&kStepX)[FarFloor::kSteps] = FarFloor::kStepX,
                    (&kStepY)[FarFloor::kSteps] = FarFloor::kStepY;

using lanes::FourFloats;  // a colour and the float after it

OMNIFLEET_INLINE float dot(const FourFloats& a, const FourFloats& b) {
  const FourFloats products = a * b;
  return products[0] + products[1] + products[2];
}

OMNIFLEET_WIDE void takeGreens(const float* __restrict means, const std::uint8_t* __restrict stops, int count,
                               std::uint8_t grown, float* __restrict greens) {
  for (int i = 0; i < count; ++i) greens[i] = stops[i] == grown ? means[3 * i + 1] : 0.0f;
}

/// |after − before − change · colour|²: what remains of the change over two blocks without the brightness
/// gradient.
OMNIFLEET_INLINE float leftOfStep(const float* after, const float* before, float change,
                                  const FourFloats& colour) {
  const FourFloats left = lanes::load<FourFloats>(after) - lanes::load<FourFloats>(before) - change * colour;
  return dot(left, left);
}

/// Squared change between two colours without its brightness part, as a share of |colour|².
OMNIFLEET_INLINE float hueStep(const float* after, const float* before, const FourFloats& colour,
                               float share_of_rr) {
  const FourFloats step = lanes::load<FourFloats>(after) - lanes::load<FourFloats>(before);
  const float along = dot(step, colour) * share_of_rr;
  return dot(step, step) * share_of_rr - along * along;
}

/// Bit k: growing may continue in the direction of step k. All directions are read at once, because one
/// branch each costs more.
OMNIFLEET_INLINE unsigned openSteps(const std::uint8_t* at, std::ptrdiff_t row_step) {
  const std::uint8_t *above = at - row_step, *below = at + row_step;
  const unsigned closed = (at[1] & 1u) | (below[0] & 1u) << 1 | (at[-1] & 1u) << 2 | (above[0] & 1u) << 3 |
                          (below[1] & 1u) << 4 | (below[-1] & 1u) << 5 | (above[-1] & 1u) << 6 |
                          (above[1] & 1u) << 7;
  return closed ^ 255u;
}

/// Tolerances of a colour, as shares of |r|.
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

RegionGrowing::RegionGrowing(const cv::Mat1b& coverage, const cv::Mat1b& seeds,
                             const FloorTolerance& tolerance, double min_share, bool all_modes)
    : tolerance_(tolerance),
      min_share_(min_share),
      all_modes_(all_modes),
      stride_(coverage.cols + 2 * kJump),
      closed_(coverage.rows + 2 * kJump, stride_, kClosed),
      framed_means_(closed_.size(), cv::Vec3f(0, 0, 0)),
      means_(framed_means_(cv::Rect(kJump, kJump, coverage.cols, coverage.rows))),
      far_(closed_.total()),
      propagated_(closed_.total()),
      light_(closed_.size(), 1.0f) {
  for (int y = 0; y < coverage.rows; ++y) {
    for (int x = 0; x < coverage.cols; ++x) {
      // The flatness of the outermost blocks cannot be determined.
      const bool inner = x > 0 && y > 0 && x + 1 < coverage.cols && y + 1 < coverage.rows;
      if (inner && coverage(y, x) == 2) closed_(y + kJump, x + kJump) = 0;
      if (seeds(y, x) != 0) seeds_.push_back((y + kJump) * stride_ + x + kJump);
    }
  }
  queue_.resize(coverage.total());  // touches all its memory before the first frame
}

cv::Mat3f& RegionGrowing::means() {
  if (is_evened_) light_ = 1.0f;
  is_evened_ = false;
  return means_;
}

void RegionGrowing::evenOut(const cv::Mat1f& light) {
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

void RegionGrowing::levels(std::vector<float>& by_number) const {
  by_number.resize(static_cast<std::size_t>(numbers()));
  takeGreens(meansByNumber(), stop_.data, numbers(), kGrown, by_number.data());
}

float RegionGrowing::brightnessAt(int number) const {
  const float* mean = framed_means_.ptr<float>() + 3 * number;
  return (mean[0] + mean[1] + mean[2]) * lightAt(number);
}

bool RegionGrowing::seed(const FloorNoise& noise) {
  if (seeds_.empty()) return false;  // the ring of seeds is thinner than a block
  const auto* means = framed_means_.ptr<cv::Vec3f>();
  // Dark seeds are brightened. Differences of brightness are small in the dark, so that otherwise objects in
  // the ring and the floor would fill adjacent bins.
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
    propagated_[static_cast<std::size_t>(block)] = {{mean[0], mean[1], mean[2], 0.0f}, {0.0f, 0.0f}};
    queue_.push_back(block);
  }
  if (!all_modes_) dropOtherHues(noise);
  dropBeyond();
  texture_ = seedTexture();
  return !queue_.empty();
}

/// Drops objects in the ring whose colours are close to the floor's. They fill adjacent bins, so the
/// histogram cannot separate them; the hue can.
void RegionGrowing::dropOtherHues(const FloorNoise& noise) {
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

/// Drops seeds on walls: near a wall the ring of seeds contains some of it. Colours beyond the floor that are
/// far from the seeds' mean are ignored from here on.
void RegionGrowing::dropBeyond() {
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

/// Gain that makes the median seed as bright as kSeedLevel, at least 1 in the actual light. (In even light a
/// seed may be brighter than any grey level.)
float RegionGrowing::brighten() {
  sorted_.clear();
  const auto* means = framed_means_.ptr<cv::Vec3f>();
  for (const int block : seeds_)
    sorted_.push_back(std::max({means[block][0], means[block][1], means[block][2]}));
  return std::max(is_evened_ ? 0.0f : 1.0f, kSeedLevel / std::max(1.0f, medianOf(sorted_)));
}

float RegionGrowing::seedTexture() {
  sorted_.clear();
  const auto* means = framed_means_.ptr<cv::Vec3f>();
  for (const int block : queue_) {
    if (stop_.data[block + 2] != kGrown) continue;
    const cv::Vec3f step = means[block + 2] - means[block];
    sorted_.push_back(std::sqrt(step.dot(step) / std::max(1.0f, means[block].dot(means[block]))));
  }
  return sorted_.empty() ? 0.0f : medianOf(sorted_);
}

void RegionGrowing::setBeyondSectors(const cv::Mat1b& sectors) {
  sector_ = cv::Mat1b(closed_.size(), std::uint8_t{0});
  sectors.copyTo(sector_(cv::Rect(kJump, kJump, sectors.cols, sectors.rows)));
}

void RegionGrowing::useFarFloor(const FarFloor& far) {
  for (int y = 0; y < means_.rows; ++y)
    for (int x = 0; x < means_.cols; ++x)
      far_[static_cast<std::size_t>(numberOf(y, x))] = far[y * means_.cols + x];
}

OMNIFLEET_INLINE RegionGrowing::Propagated RegionGrowing::steepened(const Propagated& from, float by) {
  Propagated steeper = from;
  for (float& slope : steeper.slope) slope = std::clamp(by * slope, -kMaxSlope, kMaxSlope);
  return steeper;
}

/// Squared differences of p from r, in multiples of the squared tolerances.
template <typename Colour>
OMNIFLEET_INLINE FloorTest RegionGrowing::offOf(const Colour& p, const Colour& r) const {
  const auto along = static_cast<float>(tolerance_.along), across = static_cast<float>(tolerance_.across);
  const float share = 1.0f / dot(r, r), gain = dot(p, r) * share, darker = (gain - 1.0f) / along;
  return {darker * darker, (dot(p, p) * share - gain * gain) / (across * across)};
}

/// Gain with which the propagated hue adapts to a block; negative where the block belongs to what is beyond
/// the floor. A textured surface varies in brightness more than in hue. Where the hue distinguishes both,
/// only the hue is compared, and with the seeds, so that no chain of similar blocks leads from one to the
/// other.
template <typename Colour>
OMNIFLEET_INLINE float RegionGrowing::hueGain(int at, const Colour& mean, const Colour& expected) const {
  auto beyond = lanes::load<FourFloats>(&beyond_[sector_.data[at]]);
  if (!(beyond[0] >= 0.0f)) return kLevelGain;
  if (is_evened_) beyond /= lightAt(at);  // like the means
  const auto seeds = lanes::load<FourFloats>(&of_seeds_);
  const FloorTest apart = offOf(beyond, expected), hues = offOf(beyond, seeds);
  if (apart.along2 + hues.across2 > kNear * kNear) return kLevelGain;
  const FloorTest to = offOf(mean, beyond);
  if (hues.across2 > 1.0f) return to.across2 < offOf(mean, seeds).across2 ? -1.0f : kHueGain;
  const FloorTest from = offOf(mean, expected);
  const bool is_beyond = apart.along2 > 1.0f && to.along2 + to.across2 < from.along2 + from.across2;
  return is_beyond ? -1.0f : kHueGain;
}

/// False beside closed blocks, where no floor is visible for comparison.
template <typename Colour>
OMNIFLEET_INLINE bool RegionGrowing::isAtHuesEdge(int at, const Colour& colour, float across2) const {
  const float* mean = meansByNumber() + 3 * at;
  const float share_of_rr = 1.0f / dot(colour, colour);
  const auto changes = [&](int beside) __attribute__((always_inline)) {
    if (((closed_.data[at - beside] | closed_.data[at + beside]) & kClosed) != 0) return false;
    return hueStep(mean + 3 * beside, mean - 3 * beside, colour, share_of_rr) > across2;
  };
  return changes(kBeside) || changes(kBeside * stride_);
}

/// Accepts a block when it matches the floor expected there and no edge runs through it: its neighbours on
/// both sides differ by no more than the gradient explains. Without the second condition the growing would
/// leak onto objects over blocks that their edges cut gradually.
template <bool kSmoothed>
OMNIFLEET_INLINE bool RegionGrowing::accept(int to, const Propagated& from, const FloorTest& test,
                                            float flatness, int step, int jump) {
  const float* at = framed_means_.ptr<float>() + 3 * to;
  const auto mean = lanes::load<FourFloats>(at);
  const auto dx = static_cast<float>(kStepX[step] * jump), dy = static_cast<float>(kStepY[step] * jump);
  const float change = from.slope[0] * dx + from.slope[1] * dy;
  const FourFloats expected =
      (1.0f + std::clamp(change, -kMaxSlope, kMaxSlope)) * lanes::load<FourFloats>(from.colour);
  const float share_of_rr = 1.0f / dot(expected, expected), gain = dot(mean, expected) * share_of_rr,
              innovation = gain - 1.0f;
  if (!(innovation * innovation <= test.along2)) return false;
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
  Propagated& propagated = propagated_[static_cast<std::size_t>(to)];
  const float level = 1.0f + (kLevelGain - hue_gain) * innovation;
  lanes::store((level - hue_gain) * expected + hue_gain * mean, propagated.colour);
  const float share = 1.0f / (dx * dx + dy * dy), steeper = kSlopeGain * innovation;
  propagated.slope[0] = from.slope[0] + steeper * (dx * share);
  propagated.slope[1] = from.slope[1] + steeper * (dy * share);
  queue_.push_back(to);
  return true;
}

template <bool kSmoothed>
OMNIFLEET_INLINE void RegionGrowing::growFrom(int at, const FloorNoise& noise) {
  const std::uint8_t* stop = stop_.data;
  unsigned open = openSteps(stop + at, stride_);
  if (open == 0) return;
  const FarFloor::Block& far = far_[static_cast<std::size_t>(at)];
  const Propagated from = propagated_[static_cast<std::size_t>(at)],
                   falling = steepened(from, far.steepening);
  const auto colour = lanes::load<FourFloats>(from.colour);
  const float light = lightAt(at);
  const Off tolerated = toleratedAt(std::max(1.0f, dot(colour, colour) * light * light), tolerance_, noise);
  const FloorTest test = tolerated.test();
  // The measured texture includes the noise.
  const float flatness =
      std::max(tolerated.along, static_cast<float>(tolerance_.along) + kTextureSigmas * texture_);
  for (; open != 0; open &= open - 1) {
    const int step = __builtin_ctz(open);
    const int offset = kStepY[step] * stride_ + kStepX[step];
    const float change =
        from.slope[0] * static_cast<float>(kStepX[step]) + from.slope[1] * static_cast<float>(kStepY[step]);
    const Propagated& propagated = (far.outward >> step & 1u) != 0 && change < -kFalls ? falling : from;
    for (int jump = 1, to = at + offset; jump <= kJump && stop[to] == 0; ++jump, to += offset)
      if (accept<kSmoothed>(to, propagated, test, flatness, step, jump)) break;
  }
}

bool RegionGrowing::grow(const FloorNoise& noise, const std::vector<cv::Vec4f>& beyond, bool is_smoothed) {
  beyond_.clear();
  if (!sector_.empty()) beyond_.assign(beyond.begin(), beyond.end());
  if (!seed(noise)) return false;
  if (is_smoothed) {
    propagateMeanHue(noise);
    growBySmoothedHues(noise);
  } else {
    growByMeans(noise);
  }
  return !queue_.empty();
}

/// Propagates the mean hue of all seeds instead of each seed's own. Seeds on an object's edge are dropped.
void RegionGrowing::propagateMeanHue(const FloorNoise& noise) {
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
    lanes::store(colour, propagated_[static_cast<std::size_t>(block)].colour);
    queue_[kept++] = block;
  }
  queue_.resize(kept);
}

OMNIFLEET_WIDE void RegionGrowing::growByMeans(const FloorNoise& noise) {
  growAll<false>(noise);
}

OMNIFLEET_WIDE void RegionGrowing::growBySmoothedHues(const FloorNoise& noise) {
  growAll<true>(noise);
}

template <bool kSmoothed>
OMNIFLEET_INLINE void RegionGrowing::growAll(const FloorNoise& noise) {
  // Most blocks are enclosed when their turn comes. They are sorted out by counting, many at a time, because
  // a branch for each would be mispredicted. An enclosed block stays enclosed.
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
