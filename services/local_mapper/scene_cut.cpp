#include "local_mapper/scene_cut.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::local_mapper {

namespace {

constexpr float kChanged = 12.0f;        // grey levels of a changed block
constexpr double kCutShare = 0.5;        // minimum share of changed blocks
constexpr double kCutCorrelation = 0.5;  // correlation, below which the structure is another
constexpr double kStep_m = 0.2,
                 kStep_rad = 0.3;    // motion in which an image stays the same, except for its edges
constexpr double kRestShare = 0.3;   // share of unchanged blocks from which the occlusion may be partial,
constexpr double kInnerShare = 0.5;  // if this share of them is surrounded by unchanged blocks
constexpr double kBackShare = 0.3;   // share of changed blocks, below which the former image is back
constexpr double kDriven_m = 0.1, kTurned_rad = 0.15;  // motion after which a scene has moved in the image
constexpr float kEdge = 15.0f, kMoved = 6.0f;  // grey levels: of an edge between blocks; of a change there
constexpr double kMovedShare = 0.25;           // share of the blocks at edges that must have changed
constexpr int kMovedBlocks = 4;                // and their minimum number
constexpr double kTogether = 0.5;              // correlation from one frame to the next

bool isWithin(const Pose2& moved, double metres, double radians) {
  return moved.translation().norm() <= metres && std::abs(moved.theta_rad) <= radians;
}

}  // namespace

SceneCut::SceneCut(const ViewBlocks& blocks) : blocks_(blocks) {
  tested_.reserve(blocks.inView().size());
  scene_.resize(blocks.count());
  occluded_.resize(blocks.count());
  has_changed_.assign(blocks.count(), 0);
}

void SceneCut::remember() {
  std::copy(blocks_.means().begin(), blocks_.means().end(), scene_.begin());
  since_scene_ = Pose2{};
  has_scene_ = true;
  is_occluded_ = false;
}

bool SceneCut::update(const std::vector<std::uint8_t>& usable, const Motion& wheels) {
  tested_.clear();
  for (const int i : blocks_.inView())
    if (usable[static_cast<std::size_t>(i)] != 0) tested_.push_back(i);
  if (wheels.valid) {
    since_scene_ = since_scene_ * wheels.previous_from_current;
    since_occluded_ = since_occluded_ * wheels.previous_from_current;
  }
  if (is_occluded_) {
    if (isBack() || isMoving()) remember();
  } else if (has_scene_ && wheels.valid && isCut()) {
    std::copy(blocks_.means().begin(), blocks_.means().end(), occluded_.begin());
    since_occluded_ = Pose2{};
    is_occluded_ = true;
  } else {
    remember();
  }
  return is_occluded_;
}

/// Finds the blocks that changed since the scene was last visible. @return their share of the tested blocks
double SceneCut::findChanged() {
  int changed = 0;
  std::fill(has_changed_.begin(), has_changed_.end(), std::uint8_t{0});
  for (const int i : tested_) {
    const bool differs = blocks_.differs(i, scene_, kChanged);
    has_changed_[static_cast<std::size_t>(i)] = differs ? 1 : 0;
    changed += differs ? 1 : 0;
  }
  return tested_.empty() ? 0.0 : changed / static_cast<double>(tested_.size());
}

/// Is the unchanged part large and connected? Then only a part of the view is occluded.
bool SceneCut::isRestWhole() const {
  const int width = blocks_.grid().width;
  int rest = 0, inner = 0;
  for (const int i : tested_) {
    if (has_changed_[static_cast<std::size_t>(i)] != 0) continue;
    ++rest;
    const auto around = {i - width, i - 1, i + 1, i + width};
    inner += std::none_of(around.begin(), around.end(), [&](int k) {
      return k >= 0 && k < blocks_.grid().area() && has_changed_[static_cast<std::size_t>(k)] != 0;
    });
  }
  return rest >= kRestShare * static_cast<double>(tested_.size()) && inner >= kInnerShare * rest;
}

bool SceneCut::isCut() {
  if (!isWithin(since_scene_, kStep_m, kStep_rad) || findChanged() < kCutShare || isRestWhole()) return false;
  const auto correlation = blocks_.correlation(tested_, scene_, since_scene_.theta_rad);
  return correlation && *correlation < kCutCorrelation;
}

/// Independent of how far the robot drove: the floor is the same and fills most of the image.
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

/// The image is correlated from one frame to the next, and its edges lie elsewhere than when the occluder
/// appeared.
bool SceneCut::isMoving() const {
  if (isWithin(since_occluded_, kDriven_m, kTurned_rad)) return false;
  const auto together = blocks_.correlation(tested_, blocks_.before());
  if (!together || *together < kTogether) return false;
  int edges = 0, moved = 0;
  for (const int i : tested_) {
    if (!isEdge(i, blocks_.means()) && !isEdge(i, occluded_)) continue;
    ++edges;
    const auto at = static_cast<std::size_t>(i);
    moved += ViewBlocks::difference(blocks_.means()[at], occluded_[at]) > kMoved ? 1 : 0;
  }
  return moved >= std::max<double>(kMovedBlocks, kMovedShare * edges);
}

}  // namespace omnifleet::local_mapper
