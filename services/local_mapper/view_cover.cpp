#include "local_mapper/view_cover.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace omnifleet::local_mapper {

namespace {

constexpr int kBlocksInARow = 40, kSamples = 3;  // per axis of a block
constexpr float kOneColour = 5.0f;    // grey levels by which the blocks of a cover may differ from one
constexpr float kEdge = 15.0f;        // and from what lies two blocks beside it
constexpr double kEdgeShare = 0.7;    // of what lies beside it
constexpr float kCameUp = 10.0f;      // grey levels: it changed in one frame
constexpr double kCameUpShare = 0.8;  // of its blocks
constexpr double kStep_m = 0.1, kStep_rad = 0.1;  // in which no wall comes up
constexpr double kSameShape = 0.95;               // intersection over union
constexpr float kChanged = 3.0f;                  // grey levels: what is seen there is another place
constexpr double kChangedShare = 0.3;             // of what is not covered
constexpr float kGone = 12.0f;                    // grey levels from what it was
constexpr double kGoneShare = 0.4;                // of its blocks

float difference(const cv::Vec3f& a, const cv::Vec3f& b) {
  return std::max({std::abs(a[0] - b[0]), std::abs(a[1] - b[1]), std::abs(a[2] - b[2])});
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

ViewCover::ViewCover(const ground::FloorView& view, const ViewCoverOptions& options)
    : options_(options),
      image_(view.imageSize()),
      block_px_(std::max(kSamples, (view.imageSize().width + kBlocksInARow - 1) / kBlocksInARow)) {
  grid_ = {image_.width / block_px_, image_.height / block_px_};
  const auto blocks = static_cast<std::size_t>(grid_.area());
  usable_.assign(blocks, 0);
  visited_.assign(blocks, 0);
  covered_.assign(blocks, 0);
  means_.resize(blocks);
  before_.resize(blocks);
  covered_means_.resize(blocks);
  queue_.reserve(blocks);
  drawBlocks(view);
  sorted_.reserve(view_blocks_.size());
  for (Region* regions : {followed_, next_})
    for (int k = 0; k < kFollowed; ++k) {
      regions[k].in.assign(blocks, 0);
      regions[k].means.resize(blocks);
    }
}

/// Blocks that are wholly in the view, and those of them at its outer edge: beside what can be reached from
/// outside of the image without crossing the view.
void ViewCover::drawBlocks(const ground::FloorView& view) {
  for (int i = 0; i < grid_.area(); ++i) {
    const cv::Rect block(i % grid_.width * block_px_, i / grid_.width * block_px_, block_px_, block_px_);
    usable_[static_cast<std::size_t>(i)] = cv::countNonZero(view.mask()(block)) == block.area() ? 1 : 0;
    if (usable_[static_cast<std::size_t>(i)] != 0) view_blocks_.push_back(i);
  }
  cv::Mat1b outside(grid_.height + 2, grid_.width + 2, std::uint8_t{1});
  std::vector<cv::Point> open{{0, 0}};
  outside(0, 0) = 2;
  while (!open.empty()) {
    const cv::Point at = open.back();
    open.pop_back();
    for (const cv::Point step : {cv::Point(1, 0), cv::Point(-1, 0), cv::Point(0, 1), cv::Point(0, -1)}) {
      const cv::Point to = at + step;
      if (!cv::Rect({0, 0}, outside.size()).contains(to) || outside(to) == 2) continue;
      const cv::Point block = to - cv::Point(1, 1);
      const bool inside = cv::Rect({0, 0}, grid_).contains(block) &&
                          usable_[static_cast<std::size_t>(block.y * grid_.width + block.x)] != 0;
      if (inside) {
        if (outside(to) == 1) rim_.push_back(block.y * grid_.width + block.x);
        outside(to) = 3;
        continue;
      }
      outside(to) = 2;
      open.push_back(to);
    }
  }
  std::sort(rim_.begin(), rim_.end());
}

void ViewCover::readMeans(const cv::Mat& image) {
  const int step = block_px_ / kSamples, channels = image.channels();
  for (const int i : view_blocks_) {
    const int x0 = i % grid_.width * block_px_ + step / 2, y0 = i / grid_.width * block_px_ + step / 2;
    int sum[3] = {};
    for (int y = 0; y < kSamples; ++y) {
      const std::uint8_t* row = image.ptr(y0 + y * step);
      for (int x = 0; x < kSamples; ++x)
        for (int c = 0; c < 3; ++c) sum[c] += row[(x0 + x * step) * channels + (channels == 3 ? c : 0)];
    }
    constexpr float kShare = 1.0f / (kSamples * kSamples);
    means_[static_cast<std::size_t>(i)] = {kShare * static_cast<float>(sum[0]),
                                           kShare * static_cast<float>(sum[1]),
                                           kShare * static_cast<float>(sum[2])};
  }
}

/// Of what is not covered, brightest channel.
float ViewCover::median() {
  sorted_.clear();
  for (const int i : view_blocks_) {
    const cv::Vec3f& mean = means_[static_cast<std::size_t>(i)];
    if (usable_[static_cast<std::size_t>(i)] != 0) sorted_.push_back(std::max({mean[0], mean[1], mean[2]}));
  }
  if (sorted_.empty()) return 0.0f;
  const auto middle = sorted_.begin() + static_cast<std::ptrdiff_t>(sorted_.size() / 2);
  std::nth_element(sorted_.begin(), middle, sorted_.end());
  return *middle;
}

bool ViewCover::isGone() const {
  int changed = 0, count = 0;
  for (const int i : view_blocks_) {
    const auto at = static_cast<std::size_t>(i);
    if (covered_[at] == 0) continue;
    ++count;
    changed += difference(means_[at], covered_means_[at]) > kGone ? 1 : 0;
  }
  return changed > kGoneShare * count;
}

/// The region of one colour around a block at the edge of the view; into queue_.
bool ViewCover::grow(int seed) {
  queue_.clear();
  if (visited_[static_cast<std::size_t>(seed)] != 0 || usable_[static_cast<std::size_t>(seed)] == 0)
    return false;
  const cv::Vec3f colour = means_[static_cast<std::size_t>(seed)];
  queue_.push_back(seed);
  visited_[static_cast<std::size_t>(seed)] = 1;
  for (std::size_t next = 0; next < queue_.size(); ++next) {
    const int x = queue_[next] % grid_.width, y = queue_[next] / grid_.width;
    for (const auto& [dx, dy] : {std::pair(1, 0), std::pair(-1, 0), std::pair(0, 1), std::pair(0, -1)}) {
      if (x + dx < 0 || y + dy < 0 || x + dx >= grid_.width || y + dy >= grid_.height) continue;
      const int to = (y + dy) * grid_.width + x + dx;
      const auto at = static_cast<std::size_t>(to);
      if (usable_[at] == 0 || visited_[at] != 0 || difference(means_[at], colour) > kOneColour) continue;
      visited_[at] = 1;
      queue_.push_back(to);
    }
  }
  const auto share = static_cast<double>(queue_.size()) / static_cast<double>(view_blocks_.size());
  return share >= options_.min_share && share <= options_.max_share && hasEdge();
}

/// Two blocks beside it: the one between is partly covered.
bool ViewCover::hasEdge() const {
  const cv::Vec3f& colour = means_[static_cast<std::size_t>(queue_.front())];
  int beside = 0, other = 0;
  for (const int i : queue_) {
    const int x = i % grid_.width, y = i / grid_.width;
    for (const auto& [dx, dy] : {std::pair(1, 0), std::pair(-1, 0), std::pair(0, 1), std::pair(0, -1)}) {
      const int far_x = x + 2 * dx, far_y = y + 2 * dy;
      if (far_x < 0 || far_y < 0 || far_x >= grid_.width || far_y >= grid_.height) continue;
      const auto near = static_cast<std::size_t>((y + dy) * grid_.width + x + dx),
                 far = static_cast<std::size_t>(far_y * grid_.width + far_x);
      if (usable_[near] == 0 || usable_[far] == 0 || difference(means_[near], colour) <= kOneColour) continue;
      ++beside;
      other += difference(means_[far], colour) > kEdge ? 1 : 0;
    }
  }
  return beside > 0 && other >= kEdgeShare * beside;
}

bool ViewCover::isBlack(float median) const {
  const cv::Vec3f& colour = means_[static_cast<std::size_t>(queue_.front())];
  const double level = std::max({colour[0], colour[1], colour[2]});
  return level <= options_.black_level && level <= options_.black_share * static_cast<double>(median);
}

bool ViewCover::cameUp(const Motion& wheels) const {
  if (!has_before_ || !wheels.valid) return false;
  if (wheels.previous_from_current.translation().norm() > kStep_m ||
      std::abs(wheels.previous_from_current.theta_rad) > kStep_rad)
    return false;
  const auto changed = std::count_if(queue_.begin(), queue_.end(), [&](int i) {
    return difference(means_[static_cast<std::size_t>(i)], before_[static_cast<std::size_t>(i)]) > kCameUp;
  });
  return static_cast<double>(changed) >= kCameUpShare * static_cast<double>(queue_.size());
}

/// The region is followed from frame to frame as long as it keeps its shape and colour.
bool ViewCover::hasStayed(const Motion& wheels) {
  if (next_count_ == kFollowed) return false;
  const cv::Vec3f& colour = means_[static_cast<std::size_t>(queue_.front())];
  Region& region = next_[next_count_++];
  region.count = 0;
  for (Region& then : followed_) {
    if (then.count == 0 || difference(then.colour, colour) > 2.0f * kOneColour) continue;
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
  std::copy(means_.begin(), means_.end(), region.means.begin());
  return false;
}

/// Where a floor without any pattern stays the same too, nothing tells which of both is the cover.
bool ViewCover::hasRestChanged(const Region& region) const {
  int rest = 0, changed = 0;
  for (const int i : view_blocks_) {
    const auto at = static_cast<std::size_t>(i);
    if (usable_[at] == 0 || region.in[at] != 0) continue;
    ++rest;
    changed += difference(means_[at], region.means[at]) > kChanged ? 1 : 0;
  }
  return changed >= kChangedShare * rest;
}

void ViewCover::cover() {
  for (const int i : queue_) {
    const auto at = static_cast<std::size_t>(i);
    covered_[at] = 1;
    covered_means_[at] = means_[at];
    usable_[at] = 0;
  }
}

/// With the blocks around, which are covered in part.
void ViewCover::drawMask() {
  mask_ = cv::Mat1b(image_, std::uint8_t{0});
  for (const int i : view_blocks_) {
    if (covered_[static_cast<std::size_t>(i)] == 0) continue;
    const cv::Rect around((i % grid_.width - 1) * block_px_, (i / grid_.width - 1) * block_px_, 3 * block_px_,
                          3 * block_px_);
    mask_(around & cv::Rect({0, 0}, image_)) = 255;
  }
}

double ViewCover::share() const {
  const auto covered = std::count(covered_.begin(), covered_.end(), std::uint8_t{1});
  return view_blocks_.empty() ? 0.0 : static_cast<double>(covered) / static_cast<double>(view_blocks_.size());
}

bool ViewCover::look(const cv::Mat& image, const Motion& wheels) {
  if (options_.min_share <= 0.0) return false;
  means_.swap(before_);
  readMeans(image);
  bool changed = false;
  if (!mask_.empty() && isGone()) {
    for (const int i : view_blocks_) usable_[static_cast<std::size_t>(i)] = 1;
    std::fill(covered_.begin(), covered_.end(), std::uint8_t{0});
    mask_.release();
    changed = true;
  }
  const float middle = median();
  std::fill(visited_.begin(), visited_.end(), std::uint8_t{0});
  next_count_ = 0;
  bool covers = false;
  for (const int seed : rim_) {
    if (!grow(seed)) continue;
    const bool stayed = hasStayed(wheels);
    if (!stayed && !isBlack(middle) && !cameUp(wheels)) continue;
    cover();
    covers = true;
  }
  for (int k = 0; k < kFollowed; ++k) {
    std::swap(followed_[k], next_[k]);
    if (k >= next_count_) followed_[k].count = 0;
  }
  has_before_ = true;
  if (covers) drawMask();
  return changed || covers;
}

}  // namespace omnifleet::local_mapper
