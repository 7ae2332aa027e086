#include "local_mapper/view_cover.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace omnifleet::local_mapper {

namespace {

constexpr float kOneColour = 5.0f;    // grey levels by which the blocks of a cover may differ from one
constexpr float kEdge = 15.0f;        // and from what lies two blocks beside it
constexpr double kEdgeShare = 0.7;    // of what lies beside it
constexpr float kCameUp = 10.0f;      // grey levels: it changed in one frame
constexpr double kCameUpShare = 0.8;  // of its blocks
constexpr double kStep_m = 0.1, kStep_rad = 0.1;  // in which no wall comes up
constexpr double kHueShare = 0.6;      // of the blocks of a region, of another hue: no light does that
constexpr double kNoLikeness = 0.3;    // correlation
constexpr double kSameShape = 0.95;    // intersection over union
constexpr float kChanged = 3.0f;       // grey levels: what is seen there is another place
constexpr double kChangedShare = 0.3;  // of what is not covered
constexpr float kGone = 12.0f;         // grey levels from what it was
constexpr double kGoneShare = 0.4;     // of its blocks

/// No wall comes up in it.
bool isSmall(const Motion& wheels) {
  return wheels.valid && wheels.previous_from_current.translation().norm() <= kStep_m &&
         std::abs(wheels.previous_from_current.theta_rad) <= kStep_rad;
}

}  // namespace

ViewCoverOptions ViewCoverOptions::read(const options::Section& section) {
  ViewCoverOptions o;
  section.read("min_share", o.min_share, {0.0, 1.0});
  section.read("max_share", o.max_share, {0.0, 1.0});
  section.read("black_level", o.black_level, {0.0, 255.0});
  section.read("black_share", o.black_share, {0.0, 1.0});
  section.read("moved_m", o.moved_m, {0.01, 1000.0});
  section.read("turned_rad", o.turned_rad, {0.01, 1000.0});
  section.finish();
  return o;
}

ViewCover::ViewCover(const ViewBlocks& blocks, const ViewCoverOptions& options)
    : options_(options), blocks_(blocks), grid_(blocks.grid()) {
  usable_.assign(blocks.count(), 0);
  for (const int i : blocks.inView()) usable_[static_cast<std::size_t>(i)] = 1;
  visited_.assign(blocks.count(), 0);
  covered_.assign(blocks.count(), 0);
  covered_means_.resize(blocks.count());
  queue_.reserve(blocks.count());
  sorted_.reserve(blocks.inView().size());
  for (Region* regions : {followed_, next_})
    for (int k = 0; k < kFollowed; ++k) {
      regions[k].in.assign(blocks.count(), 0);
      regions[k].means.resize(blocks.count());
    }
}

/// Of what is not covered, brightest channel.
float ViewCover::median() {
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

bool ViewCover::isGone() const {
  int changed = 0, count = 0;
  for (const int i : blocks_.inView()) {
    const auto at = static_cast<std::size_t>(i);
    if (covered_[at] == 0) continue;
    ++count;
    changed += ViewBlocks::difference(blocks_.means()[at], covered_means_[at]) > kGone ? 1 : 0;
  }
  return changed > kGoneShare * count;
}

/// The region around a block at the edge of the view; into queue_. @return whether it is of a cover's size
template <class Belongs>
bool ViewCover::grow(int seed, Belongs belongs) {
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

bool ViewCover::growOneColour(int seed) {
  const cv::Vec3f colour = blocks_.means()[static_cast<std::size_t>(seed)];
  return grow(seed,
              [&](std::size_t at) {
                return ViewBlocks::difference(blocks_.means()[at], colour) <= kOneColour;
              }) &&
         hasEdge();
}

/// Two blocks beside it: the one between is partly covered.
bool ViewCover::hasEdge() const {
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

bool ViewCover::isBlack(float median) const {
  const cv::Vec3f& colour = blocks_.means()[static_cast<std::size_t>(queue_.front())];
  const double level = std::max({colour[0], colour[1], colour[2]});
  return level <= options_.black_level && level <= options_.black_share * static_cast<double>(median);
}

bool ViewCover::cameUp(const Motion& wheels) const {
  const cv::Vec3f& colour = blocks_.means()[static_cast<std::size_t>(queue_.front())];
  if (!blocks_.hasBefore() || !isSmall(wheels) || ViewBlocks::isSaturated(colour)) return false;
  const auto changed = std::count_if(queue_.begin(), queue_.end(), [&](int i) {
    return ViewBlocks::difference(blocks_.means()[static_cast<std::size_t>(i)],
                                  blocks_.before()[static_cast<std::size_t>(i)]) > kCameUp;
  });
  return static_cast<double>(changed) >= kCameUpShare * static_cast<double>(queue_.size());
}

/// The region is followed from frame to frame as long as it keeps its shape and colour.
bool ViewCover::hasStayed(const Motion& wheels) {
  if (next_count_ == kFollowed) return false;
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

/// Where a floor without any pattern stays the same too, nothing tells which of both is the cover.
bool ViewCover::hasRestChanged(const Region& region) const {
  int rest = 0, changed = 0;
  for (const int i : blocks_.inView()) {
    const auto at = static_cast<std::size_t>(i);
    if (usable_[at] == 0 || region.in[at] != 0) continue;
    ++rest;
    changed += ViewBlocks::difference(blocks_.means()[at], region.means[at]) > kChanged ? 1 : 0;
  }
  return changed >= kChangedShare * rest;
}

void ViewCover::cover() {
  for (const int i : queue_) {
    const auto at = static_cast<std::size_t>(i);
    covered_[at] = 1;
    covered_means_[at] = blocks_.means()[at];
    usable_[at] = 0;
  }
}

/// With the blocks around, which are covered in part.
void ViewCover::drawMask() {
  const int side = blocks_.side_px();
  mask_ = cv::Mat1b(blocks_.image(), std::uint8_t{0});
  for (const int i : blocks_.inView()) {
    if (covered_[static_cast<std::size_t>(i)] == 0) continue;
    const cv::Rect around((i % grid_.width - 1) * side, (i / grid_.width - 1) * side, 3 * side, 3 * side);
    mask_(around & cv::Rect({0, 0}, blocks_.image())) = 255;
  }
}

double ViewCover::share() const {
  const auto covered = std::count(covered_.begin(), covered_.end(), std::uint8_t{1});
  return blocks_.inView().empty()
             ? 0.0
             : static_cast<double>(covered) / static_cast<double>(blocks_.inView().size());
}

/// Of one colour each.
bool ViewCover::coverOneColour(const Motion& wheels) {
  const float middle = median();
  std::fill(visited_.begin(), visited_.end(), std::uint8_t{0});
  next_count_ = 0;
  bool covers = false;
  for (const int seed : blocks_.rim()) {
    if (!growOneColour(seed)) continue;
    const bool stayed = hasStayed(wheels);
    if (!stayed && !isBlack(middle) && !cameUp(wheels)) continue;
    cover();
    covers = true;
  }
  for (int k = 0; k < kFollowed; ++k) {
    std::swap(followed_[k], next_[k]);
    if (k >= next_count_) followed_[k].count = 0;
  }
  return covers;
}

/// Of whatever look.
bool ViewCover::coverWhatCameUp(const Motion& wheels) {
  if (!blocks_.hasBefore() || !isSmall(wheels)) return false;
  std::fill(visited_.begin(), visited_.end(), std::uint8_t{0});
  const auto hasComeUp = [&](std::size_t at) {
    return !ViewBlocks::isSaturated(blocks_.means()[at]) &&
           blocks_.differs(static_cast<int>(at), blocks_.before(), kCameUp);
  };
  bool covers = false;
  for (const int seed : blocks_.rim()) {
    if (!grow(seed, hasComeUp) || (!hasAnotherHue() && !lostStructure())) continue;
    cover();
    covers = true;
  }
  return covers;
}

bool ViewCover::hasAnotherHue() const {
  const auto other = std::count_if(queue_.begin(), queue_.end(), [&](int i) {
    const auto at = static_cast<std::size_t>(i);
    return ViewBlocks::hueDifference(blocks_.means()[at], blocks_.before()[at]) > ViewBlocks::kAnotherHue;
  });
  return static_cast<double>(other) >= kHueShare * static_cast<double>(queue_.size());
}

bool ViewCover::lostStructure() const {
  const auto likeness = blocks_.likeness(queue_, blocks_.before());
  return likeness && *likeness < kNoLikeness;
}

bool ViewCover::look(const Motion& wheels) {
  if (options_.min_share <= 0.0) return false;
  bool changed = false;
  if (!mask_.empty() && isGone()) {
    for (const int i : blocks_.inView()) usable_[static_cast<std::size_t>(i)] = 1;
    std::fill(covered_.begin(), covered_.end(), std::uint8_t{0});
    mask_.release();
    changed = true;
  }
  bool covers = coverOneColour(wheels);
  if (!changed) covers = coverWhatCameUp(wheels) || covers;
  if (covers) drawMask();
  return changed || covers;
}

}  // namespace omnifleet::local_mapper
