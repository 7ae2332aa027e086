#include "local_mapper/scene_cut.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::local_mapper {

namespace {

constexpr float kChanged = 12.0f;                 // grey levels
constexpr double kCutShare = 0.5;                 // of the blocks
constexpr double kCutLikeness = 0.5;              // correlation
constexpr double kStep_m = 0.2, kStep_rad = 0.3;  // in which a picture remains the same, but for its edges
constexpr double kRestShare = 0.3;                // of the blocks, as a cover of a part leaves, …
constexpr double kInnerShare = 0.5;               // did not change, and of them so many lie among their own
constexpr double kBackShare = 0.3;                // of the blocks
constexpr double kDriven_m = 0.1, kTurned_rad = 0.15;  // after which a world has moved in the picture
constexpr float kEdge = 15.0f, kMoved = 6.0f;          // grey levels
constexpr double kMovedShare = 0.25;                   // of the blocks at edges …
constexpr int kMovedBlocks = 4;                        // … and at least
constexpr double kTogether = 0.5;                      // correlation from one frame to the next

bool isWithin(const Pose2& moved, double metres, double radians) {
  return moved.translation().norm() <= metres && std::abs(moved.theta_rad) <= radians;
}

}  // namespace

SceneCut::SceneCut(const ViewBlocks& blocks) : blocks_(blocks) {
  looked_at_.reserve(blocks.inView().size());
  world_.resize(blocks.count());
  covered_.resize(blocks.count());
  has_changed_.assign(blocks.count(), 0);
}

void SceneCut::remember() {
  std::copy(blocks_.means().begin(), blocks_.means().end(), world_.begin());
  since_world_ = Pose2{};
  has_world_ = true;
  is_covered_ = false;
}

bool SceneCut::look(const std::vector<std::uint8_t>& usable, const Motion& wheels) {
  looked_at_.clear();
  for (const int i : blocks_.inView())
    if (usable[static_cast<std::size_t>(i)] != 0) looked_at_.push_back(i);
  if (wheels.valid) {
    since_world_ = since_world_ * wheels.previous_from_current;
    since_covered_ = since_covered_ * wheels.previous_from_current;
  }
  if (is_covered_) {
    if (isBack() || isMoving()) remember();
  } else if (has_world_ && wheels.valid && isCut()) {
    std::copy(blocks_.means().begin(), blocks_.means().end(), covered_.begin());
    since_covered_ = Pose2{};
    is_covered_ = true;
  } else {
    remember();
  }
  return is_covered_;
}

/// Since the world was seen. @return their share of those looked at
double SceneCut::findChanged() {
  int changed = 0;
  std::fill(has_changed_.begin(), has_changed_.end(), std::uint8_t{0});
  for (const int i : looked_at_) {
    const bool differs = blocks_.differs(i, world_, kChanged);
    has_changed_[static_cast<std::size_t>(i)] = differs ? 1 : 0;
    changed += differs ? 1 : 0;
  }
  return looked_at_.empty() ? 0.0 : changed / static_cast<double>(looked_at_.size());
}

/// What did not change is much and lies together: a part of the view is covered, the rest is not.
bool SceneCut::isRestWhole() const {
  const int width = blocks_.grid().width;
  int rest = 0, inner = 0;
  for (const int i : looked_at_) {
    if (has_changed_[static_cast<std::size_t>(i)] != 0) continue;
    ++rest;
    const auto around = {i - width, i - 1, i + 1, i + width};
    inner += std::none_of(around.begin(), around.end(), [&](int k) {
      return k >= 0 && k < blocks_.grid().area() && has_changed_[static_cast<std::size_t>(k)] != 0;
    });
  }
  return rest >= kRestShare * static_cast<double>(looked_at_.size()) && inner >= kInnerShare * rest;
}

bool SceneCut::isCut() {
  if (!isWithin(since_world_, kStep_m, kStep_rad) || findChanged() < kCutShare || isRestWhole()) return false;
  const auto likeness = blocks_.likeness(looked_at_, world_, since_world_.theta_rad);
  return likeness && *likeness < kCutLikeness;
}

/// However far the robot drove: the floor is the same, and fills most of the picture.
bool SceneCut::isBack() {
  return findChanged() < kBackShare;
}

bool SceneCut::isEdge(int block, const ViewBlocks::Means& means) const {
  const cv::Size grid = blocks_.grid();
  const int x = block % grid.width, y = block / grid.width;
  for (const auto& [dx, dy] : {std::pair(1, 0), std::pair(-1, 0), std::pair(0, 1), std::pair(0, -1)}) {
    if (!cv::Rect({0, 0}, grid).contains({x + dx, y + dy})) continue;
    const int beside = block + dy * grid.width + dx;
    if (blocks_.isInView(beside) && ViewBlocks::difference(means[static_cast<std::size_t>(block)],
                                                           means[static_cast<std::size_t>(beside)]) > kEdge)
      return true;
  }
  return false;
}

/// It holds together from one frame to the next, and its edges lie elsewhere than where the cover came up.
bool SceneCut::isMoving() const {
  if (isWithin(since_covered_, kDriven_m, kTurned_rad)) return false;
  const auto together = blocks_.likeness(looked_at_, blocks_.before());
  if (!together || *together < kTogether) return false;
  int edges = 0, moved = 0;
  for (const int i : looked_at_) {
    if (!isEdge(i, blocks_.means()) && !isEdge(i, covered_)) continue;
    ++edges;
    const auto at = static_cast<std::size_t>(i);
    moved += ViewBlocks::difference(blocks_.means()[at], covered_[at]) > kMoved ? 1 : 0;
  }
  return moved >= std::max<double>(kMovedBlocks, kMovedShare * edges);
}

}  // namespace omnifleet::local_mapper
