#include "local_mapper/lens_occlusion.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace omnifleet::local_mapper {

namespace {

constexpr float kOneColour =
    5.0f;                       // grey levels by which the blocks of an occluder may differ from one block
constexpr float kEdge = 15.0f;  // grey levels from what lies two blocks beside it
constexpr double kEdgeShare = 0.7;                // share of the blocks beside it that differ so
constexpr float kSuddenChange = 10.0f;            // grey levels of change within one frame
constexpr double kSuddenShare = 0.8;              // share of its blocks that change so
constexpr double kStep_m = 0.1, kStep_rad = 0.1;  // motion in which no wall can appear
constexpr double kHueShare = 0.6;      // share of a region's blocks that change their hue; no light does that
constexpr double kUncorrelated = 0.3;  // correlation, below which the structure is gone
constexpr double kSameShape = 0.95;    // intersection over union
constexpr float kChanged = 3.0f;       // grey levels: another place is visible
constexpr double kChangedShare = 0.3;  // share of the blocks that are not occluded
constexpr float kGone = 12.0f;         // grey levels of change since the occlusion
constexpr double kGoneShare = 0.4;     // share of the occluded blocks

/// No wall can appear in such a motion.
bool isSmall(const Motion& wheels) {
  return wheels.valid && wheels.previous_from_current.translation().norm() <= kStep_m &&
         std::abs(wheels.previous_from_current.theta_rad) <= kStep_rad;
}

}  // namespace

LensOcclusionOptions LensOcclusionOptions::read(const options::Section& section) {
  LensOcclusionOptions o;
  section.read("min_share", o.min_share, {0.0, 1.0});
  section.read("max_share", o.max_share, {0.0, 1.0});
  section.read("black_level", o.black_level, {0.0, 255.0});
  section.read("black_share", o.black_share, {0.0, 1.0});
  section.read("moved_m", o.moved_m, {0.01, 1000.0});
  section.read("turned_rad", o.turned_rad, {0.01, 1000.0});
  section.finish();
  return o;
}

LensOcclusion::LensOcclusion(const ViewBlocks& blocks, const LensOcclusionOptions& options)
    : options_(options), blocks_(blocks), grid_(blocks.grid()) {
  usable_.assign(blocks.count(), 0);
  for (const int i : blocks.inView()) usable_[static_cast<std::size_t>(i)] = 1;
  visited_.assign(blocks.count(), 0);
  occluded_.assign(blocks.count(), 0);
  occluded_means_.resize(blocks.count());
  queue_.reserve(blocks.count());
  sorted_.reserve(blocks.inView().size());
  for (Region* regions : {followed_, next_})
    for (int k = 0; k < kMaxFollowed; ++k) {
      regions[k].in.assign(blocks.count(), 0);
      regions[k].means.resize(blocks.count());
    }
}

/// Of the blocks that are not occluded, brightest channel.
float LensOcclusion::median() {
  sorted_.clear();
  for (const int i : blocks_.inView()) {
    const cv::Vec3f& mean = blocks_.means()[static_cast<std::size_t>(i)];
    if (usable_[static_cast<std::size_t>(i)] != 0) sorted_.push_back(std::max({mean[0], mean[1], mean[2]}));
  }
  if (sorted_.empty()) return 0.0f;
  const auto middle = sorted_.begin() + static_cast<std::ptrdiff_t>(sorted_.size() / 2);
  std::nth_element(sorted_.begin(), middle, sorted_.end());
  return *middle;
}

bool LensOcclusion::isGone() const {
  int changed = 0, count = 0;
  for (const int i : blocks_.inView()) {
    const auto at = static_cast<std::size_t>(i);
    if (occluded_[at] == 0) continue;
    ++count;
    changed += ViewBlocks::difference(blocks_.means()[at], occluded_means_[at]) > kGone ? 1 : 0;
  }
  return changed > kGoneShare * count;
}

/// Finds the region around a block at the edge of the view, into queue_. @return whether it has the size of
/// an occluder
template <class Belongs>
bool LensOcclusion::grow(int seed, Belongs belongs) {
  queue_.clear();
  const auto take = [&](int i) {
    const auto at = static_cast<std::size_t>(i);
    if (usable_[at] == 0 || visited_[at] != 0 || !belongs(at)) return;
    visited_[at] = 1;
    queue_.push_back(i);
  };
  take(seed);
  for (std::size_t next = 0; next < queue_.size(); ++next) {
    const int x = queue_[next] % grid_.width, y = queue_[next] / grid_.width;
    for (const auto& [dx, dy] : {std::pair(1, 0), std::pair(-1, 0), std::pair(0, 1), std::pair(0, -1)}) {
      if (cv::Rect({0, 0}, grid_).contains({x + dx, y + dy})) take((y + dy) * grid_.width + x + dx);
    }
  }
  const auto share = static_cast<double>(queue_.size()) / static_cast<double>(blocks_.inView().size());
  return share >= options_.min_share && share <= options_.max_share;
}

bool LensOcclusion::growOneColour(int seed) {
  const cv::Vec3f colour = blocks_.means()[static_cast<std::size_t>(seed)];
  return grow(seed,
              [&](std::size_t at) {
                return ViewBlocks::difference(blocks_.means()[at], colour) <= kOneColour;
              }) &&
         hasEdge();
}

/// Tests the blocks two steps beside the region, because the block in between is partly occluded.
bool LensOcclusion::hasEdge() const {
  const cv::Vec3f& colour = blocks_.means()[static_cast<std::size_t>(queue_.front())];
  int beside = 0, other = 0;
  for (const int i : queue_) {
    const int x = i % grid_.width, y = i / grid_.width;
    for (const auto& [dx, dy] : {std::pair(1, 0), std::pair(-1, 0), std::pair(0, 1), std::pair(0, -1)}) {
      const int far_x = x + 2 * dx, far_y = y + 2 * dy;
      if (far_x < 0 || far_y < 0 || far_x >= grid_.width || far_y >= grid_.height) continue;
      const auto near = static_cast<std::size_t>((y + dy) * grid_.width + x + dx),
                 far = static_cast<std::size_t>(far_y * grid_.width + far_x);
      if (usable_[near] == 0 || usable_[far] == 0 ||
          ViewBlocks::difference(blocks_.means()[near], colour) <= kOneColour)
        continue;
      ++beside;
      other += ViewBlocks::difference(blocks_.means()[far], colour) > kEdge ? 1 : 0;
    }
  }
  return beside > 0 && other >= kEdgeShare * beside;
}

bool LensOcclusion::isBlack(float median) const {
  const cv::Vec3f& colour = blocks_.means()[static_cast<std::size_t>(queue_.front())];
  const double level = std::max({colour[0], colour[1], colour[2]});
  return level <= options_.black_level && level <= options_.black_share * static_cast<double>(median);
}

bool LensOcclusion::hasAppeared(const Motion& wheels) const {
  const cv::Vec3f& colour = blocks_.means()[static_cast<std::size_t>(queue_.front())];
  if (!blocks_.hasBefore() || !isSmall(wheels) || ViewBlocks::isSaturated(colour)) return false;
  const auto changed = std::count_if(queue_.begin(), queue_.end(), [&](int i) {
    return ViewBlocks::difference(blocks_.means()[static_cast<std::size_t>(i)],
                                  blocks_.before()[static_cast<std::size_t>(i)]) > kSuddenChange;
  });
  return static_cast<double>(changed) >= kSuddenShare * static_cast<double>(queue_.size());
}

/// Follows the region from frame to frame as long as it keeps its shape and colour.
bool LensOcclusion::hasStayed(const Motion& wheels) {
  if (next_count_ == kMaxFollowed) return false;
  const cv::Vec3f& colour = blocks_.means()[static_cast<std::size_t>(queue_.front())];
  Region& region = next_[next_count_++];
  region.count = 0;
  for (Region& then : followed_) {
    if (then.count == 0 || ViewBlocks::difference(then.colour, colour) > 2.0f * kOneColour) continue;
    const auto both = std::count_if(queue_.begin(), queue_.end(),
                                    [&](int i) { return then.in[static_cast<std::size_t>(i)] != 0; });
    const auto either =
        static_cast<double>(then.count) + static_cast<double>(queue_.size()) - static_cast<double>(both);
    if (static_cast<double>(both) < kSameShape * either) continue;
    std::swap(region, then);
    if (wheels.valid) region.moved = region.moved * wheels.previous_from_current;
    return (region.moved.translation().norm() > options_.moved_m ||
            std::abs(region.moved.theta_rad) > options_.turned_rad) &&
           hasRestChanged(region);
  }
  std::fill(region.in.begin(), region.in.end(), std::uint8_t{0});
  for (const int i : queue_) region.in[static_cast<std::size_t>(i)] = 1;
  region.count = static_cast<int>(queue_.size());
  region.colour = colour;
  region.moved = Pose2{};
  std::copy(blocks_.means().begin(), blocks_.means().end(), region.means.begin());
  return false;
}

/// Where a floor without any pattern stays the same, too, the occluder cannot be identified.
bool LensOcclusion::hasRestChanged(const Region& region) const {
  int rest = 0, changed = 0;
  for (const int i : blocks_.inView()) {
    const auto at = static_cast<std::size_t>(i);
    if (usable_[at] == 0 || region.in[at] != 0) continue;
    ++rest;
    changed += ViewBlocks::difference(blocks_.means()[at], region.means[at]) > kChanged ? 1 : 0;
  }
  return changed >= kChangedShare * rest;
}

void LensOcclusion::markOccluded() {
  for (const int i : queue_) {
    const auto at = static_cast<std::size_t>(i);
    occluded_[at] = 1;
    occluded_means_[at] = blocks_.means()[at];
    usable_[at] = 0;
  }
}

/// Includes the neighbouring blocks, which are partly occluded.
void LensOcclusion::drawMask() {
  const int side = blocks_.side_px();
  mask_ = cv::Mat1b(blocks_.image(), std::uint8_t{0});
  for (const int i : blocks_.inView()) {
    if (occluded_[static_cast<std::size_t>(i)] == 0) continue;
    const cv::Rect around((i % grid_.width - 1) * side, (i / grid_.width - 1) * side, 3 * side, 3 * side);
    mask_(around & cv::Rect({0, 0}, blocks_.image())) = 255;
  }
}

double LensOcclusion::share() const {
  const auto occluded = std::count(occluded_.begin(), occluded_.end(), std::uint8_t{1});
  return blocks_.inView().empty()
             ? 0.0
             : static_cast<double>(occluded) / static_cast<double>(blocks_.inView().size());
}

/// Finds occluders of one colour.
bool LensOcclusion::findUniformOcclusion(const Motion& wheels) {
  const float middle = median();
  std::fill(visited_.begin(), visited_.end(), std::uint8_t{0});
  next_count_ = 0;
  bool any_occluded = false;
  for (const int seed : blocks_.rim()) {
    if (!growOneColour(seed)) continue;
    const bool stayed = hasStayed(wheels);
    if (!stayed && !isBlack(middle) && !hasAppeared(wheels)) continue;
    markOccluded();
    any_occluded = true;
  }
  for (int k = 0; k < kMaxFollowed; ++k) {
    std::swap(followed_[k], next_[k]);
    if (k >= next_count_) followed_[k].count = 0;
  }
  return any_occluded;
}

/// Finds occluders of any appearance.
bool LensOcclusion::findSuddenOcclusion(const Motion& wheels) {
  if (!blocks_.hasBefore() || !isSmall(wheels)) return false;
  std::fill(visited_.begin(), visited_.end(), std::uint8_t{0});
  const auto hasChanged = [&](std::size_t at) {
    return !ViewBlocks::isSaturated(blocks_.means()[at]) &&
           blocks_.differs(static_cast<int>(at), blocks_.before(), kSuddenChange);
  };
  bool any_occluded = false;
  for (const int seed : blocks_.rim()) {
    if (!grow(seed, hasChanged) || (!hasAnotherHue() && !lostStructure())) continue;
    markOccluded();
    any_occluded = true;
  }
  return any_occluded;
}

bool LensOcclusion::hasAnotherHue() const {
  const auto other = std::count_if(queue_.begin(), queue_.end(), [&](int i) {
    const auto at = static_cast<std::size_t>(i);
    return ViewBlocks::hueDifference(blocks_.means()[at], blocks_.before()[at]) > ViewBlocks::kAnotherHue;
  });
  return static_cast<double>(other) >= kHueShare * static_cast<double>(queue_.size());
}

bool LensOcclusion::lostStructure() const {
  const auto correlation = blocks_.correlation(queue_, blocks_.before());
  return correlation && *correlation < kUncorrelated;
}

bool LensOcclusion::update(const Motion& wheels) {
  if (options_.min_share <= 0.0) return false;
  bool changed = false;
  if (!mask_.empty() && isGone()) {
    for (const int i : blocks_.inView()) usable_[static_cast<std::size_t>(i)] = 1;
    std::fill(occluded_.begin(), occluded_.end(), std::uint8_t{0});
    mask_.release();
    changed = true;
  }
  bool any_occluded = findUniformOcclusion(wheels);
  if (!changed) any_occluded = findSuddenOcclusion(wheels) || any_occluded;
  if (any_occluded) drawMask();
  return changed || any_occluded;
}

}  // namespace omnifleet::local_mapper
