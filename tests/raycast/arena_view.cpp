#include "tests/raycast/arena_view.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace omnifleet::raycast {
namespace {

constexpr float kNone = std::numeric_limits<float>::infinity();
constexpr float kHorizon = 1e-5F;

std::vector<Eigen::Vector3d> cornersOf(const ArenaBox& box, double wider_m) {
  std::vector<Eigen::Vector3d> corners;
  const Eigen::Vector2d half = box.half_m + Eigen::Vector2d::Constant(wider_m);
  for (const double x : {-half.x(), half.x()}) {
    for (const double y : {-half.y(), half.y()}) {
      const Eigen::Vector2d corner = box.toMap({x, y});
      for (const double z : {0.0, box.height_m}) corners.emplace_back(corner.x(), corner.y(), z);
    }
  }
  return corners;
}

/// Range at which a ray enters a box, and the face; infinity if the ray misses the box.
std::pair<float, Surface3::Face> entry(const Eigen::Vector3f& from, const Eigen::Vector3f& along,
                                       const ArenaBox& box) {
  const Eigen::Vector3f high(static_cast<float>(box.half_m.x()), static_cast<float>(box.half_m.y()),
                             static_cast<float>(box.height_m));
  const Eigen::Vector3f low(-high.x(), -high.y(), 0.0F);
  float enter = 0.0F, leave = kNone;
  int axis = -1;
  for (int k = 0; k < 3; ++k) {
    const float inverse = 1.0F / along[k];
    float a = (low[k] - from[k]) * inverse, b = (high[k] - from[k]) * inverse;
    if (a > b) std::swap(a, b);
    if (a > enter) {
      enter = a;
      axis = k;
    }
    leave = std::min(leave, b);
  }
  if (axis < 0 || !(enter < leave)) return {kNone, Surface3::kSky};
  if (axis == 2) return {along.z() < 0.0F ? enter : kNone, Surface3::kTop};
  if (axis == 0) return {enter, along.x() > 0.0F ? Surface3::kBack : Surface3::kFront};
  return {enter, along.y() > 0.0F ? Surface3::kRight : Surface3::kLeft};
}

/// Point where a ray meets the plane of a face.
Eigen::Vector3f onFace(const Eigen::Vector3f& from, const Eigen::Vector3f& along, const ArenaBox& box,
                       Surface3::Face face) {
  const int axis = face == Surface3::kTop ? 2 : face == Surface3::kBack || face == Surface3::kFront ? 0 : 1;
  const double sign = face == Surface3::kBack || face == Surface3::kRight ? -1.0 : 1.0;
  const double plane = axis == 2 ? box.height_m : sign * box.half_m[axis];
  return from + along * ((static_cast<float>(plane) - from[axis]) / along[axis]);
}

}  // namespace

template <typename Visit>
void ArenaView::forTiles(const ArenaBox& box, double wider_m, const Visit& visit) const {
  const Eigen::Isometry3d camera_from_map = map_from_camera_.inverse();
  std::vector<Eigen::Vector3d> corners = cornersOf(box, wider_m);
  for (Eigen::Vector3d& corner : corners) corner = camera_from_map * corner;
  if (std::none_of(corners.begin(), corners.end(), [](const auto& corner) { return corner.z() > 0.0; }))
    return;
  const auto bounds = ArenaCamera::boundsOf(corners);
  for (int row = 0; row < camera_->tileRows(); ++row) {
    for (int column = 0; column < camera_->tileColumns(); ++column) {
      const cv::Rect_<float>& tile = camera_->tile(column, row);
      if (bounds && (bounds->x > tile.x + tile.width || bounds->x + bounds->width < tile.x ||
                     bounds->y > tile.y + tile.height || bounds->y + bounds->height < tile.y))
        continue;
      visit(static_cast<std::size_t>(row * camera_->tileColumns() + column));
    }
  }
}

ArenaView::ArenaView(const ArenaScene& scene, const ArenaCamera& camera, const Pose2& map_from_parent,
                     const std::vector<ArenaBox>& moving, int own)
    : scene_(&scene), camera_(&camera), moving_(&moving) {
  Eigen::Isometry3d lifted = Eigen::Isometry3d::Identity();
  lifted.linear().topLeftCorner<2, 2>() = map_from_parent.rotation();
  lifted.translation().head<2>() = map_from_parent.translation();
  map_from_camera_ = lifted * camera.parentFromCamera();
  rotation_ = map_from_camera_.linear().cast<float>();
  from_ = map_from_camera_.translation().cast<float>();
  candidates_.resize(static_cast<std::size_t>(camera.tileColumns() * camera.tileRows()));
  const auto add = [&](const ArenaBox& box) {
    const Eigen::Vector2d from = box.toBox(map_from_camera_.translation().head<2>());
    const auto index = static_cast<int>(placed_.size());
    placed_.push_back({&box,
                       box.map_from_box.transpose().cast<float>(),
                       {static_cast<float>(from.x()), static_cast<float>(from.y()), from_.z()}});
    forTiles(box, 0.0, [&](std::size_t tile) { candidates_[tile].push_back(index); });
  };
  for (const ArenaBox& box : scene.boxes()) add(box);
  for (std::size_t k = 0; k < moving.size(); ++k)
    if (static_cast<int>(k) != own) add(moving[k]);
}

Surface3 ArenaView::surfaceAlong(std::size_t tile, const Eigen::Vector3f& along) const {
  Surface3 surface;
  float nearest = kNone;
  if (along.z() < -kHorizon) {
    nearest = -from_.z() / along.z();
    surface.face = Surface3::kFloor;
  }
  for (const int index : candidates_[tile]) {
    const Placed& placed = placed_[static_cast<std::size_t>(index)];
    const auto [range, face] = entry(placed.from, placed.along(along), *placed.box);
    if (!(range < nearest)) continue;
    nearest = range;
    surface.box = index;
    surface.face = face;
  }
  if (surface.face == Surface3::kFloor) surface.paint = scene_->cardAt(floorAlong(along));
  if (surface.face == Surface3::kTop) {
    const Placed& placed = placed_[static_cast<std::size_t>(surface.box)];
    const Eigen::Vector3f at = onFace(placed.from, placed.along(along), *placed.box, Surface3::kTop);
    surface.paint = scene_->paintAt(*placed.box, at.head<2>().cast<double>());
  }
  return surface;
}

Eigen::Vector3f ArenaView::radiance(const Surface3& surface, const Eigen::Vector3f& along) const {
  if (surface.face == Surface3::kSky) return scene_->skyAlong(along.normalized());
  if (surface.face == Surface3::kFloor)
    return scene_->floorAt(floorAlong(along), surface.paint, along.normalized(), *moving_);
  const Placed& placed = placed_[static_cast<std::size_t>(surface.box)];
  const Eigen::Vector3f at = onFace(placed.from, placed.along(along), *placed.box, surface.face);
  return scene_->boxAt(*placed.box, surface.face, surface.paint, at.cast<double>());
}

std::vector<char> ArenaView::tilesAroundMoving() const {
  std::vector<char> tiles(candidates_.size(), 0);
  for (const ArenaBox& box : *moving_)
    forTiles(box, ArenaScene::kShadow_m, [&](std::size_t tile) { tiles[tile] = 1; });
  return tiles;
}

}  // namespace omnifleet::raycast
