#include "synthetic/stage_set.h"

#include <algorithm>
#include <cmath>

#include "synthetic/value_noise.h"

namespace omnifleet::synthetic {
namespace {

constexpr int kFacesPerSolid = 1024;
constexpr float kMottleM = 0.03f;  // size of the spots on surfaces

Eigen::Affine3f affine(const Pose2& pose) {
  Eigen::Affine3f transform = Eigen::Affine3f::Identity();
  transform.translation() = Eigen::Vector3d(pose.x_m, pose.y_m, 0.0).cast<float>();
  transform.linear() =
      Eigen::AngleAxisd(pose.theta_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix().cast<float>();
  return transform;
}

}  // namespace

std::vector<SolidMesh> StageSet::meshes(const Arena& arena, int own_robot) {
  std::vector<SolidMesh> meshes;
  for (const Solid& solid : arena.solids) meshes.push_back(meshOf(solid));
  for (int i = 0; i < static_cast<int>(arena.robots.size()); ++i) {
    if (i != own_robot) meshes.push_back(meshOf(arena.robots[static_cast<std::size_t>(i)], arena.markers));
  }
  return meshes;
}

StageSet::StageSet(const Arena& arena, int own_robot, std::uint32_t seed)
    : meshes_(meshes(arena, own_robot)), tracer_(meshes_), seed_(hash32(seed, 0x50f1d)), light_(arena.light) {
  for (int i = 0; i < static_cast<int>(arena.robots.size()); ++i) {
    if (i != own_robot) robots_.push_back(i);
  }
  for (std::size_t i = 0; i < meshes_.size(); ++i) {
    const bool box = i < arena.solids.size() && arena.solids[i].kind == SolidKind::kBox;
    addBalls(static_cast<int>(i), meshes_[i], box ? arena.solids[i].size_m : Eigen::Vector2d::Zero());
  }
}

void StageSet::addBalls(int solid, const SolidMesh& mesh, const Eigen::Vector2d& size_m) {
  const float half_height_m = 0.5f * mesh.height_m;
  const Eigen::Vector3f middle(0.0f, 0.0f, half_height_m);
  if (size_m.isZero()) {
    balls_.push_back({solid, middle, std::hypot(mesh.radius_m, half_height_m)});
    return;
  }
  // A long box is approximated by a row of balls. Each piece is about as long as the box is wide or high.
  const int along = size_m.x() >= size_m.y() ? 0 : 1;
  const auto length_m = static_cast<float>(size_m[along]), width_m = static_cast<float>(size_m[1 - along]);
  const int pieces = std::max(1, static_cast<int>(std::ceil(length_m / std::max(width_m, mesh.height_m))));
  const float piece_m = length_m / static_cast<float>(pieces);
  for (int i = 0; i < pieces; ++i) {
    Eigen::Vector3f centre = middle;
    centre[along] = (static_cast<float>(i) + 0.5f) * piece_m - 0.5f * length_m;
    balls_.push_back({solid, centre, 0.5f * Eigen::Vector3f(piece_m, width_m, mesh.height_m).norm()});
  }
}

void StageSet::place(const Arena& arena, double time_s, const std::vector<Pose2>& map_from_bases,
                     const Pose2& parent_from_map) {
  time_s_ = time_s;
  map_from_parent_ = parent_from_map.inverse();
  map_from_solids_.clear();
  for (std::size_t i = 0; i < arena.solids.size(); ++i) {
    map_from_solids_.push_back(arena.solidAt(static_cast<int>(i), time_s));
  }
  for (int robot : robots_) map_from_solids_.push_back(map_from_bases[static_cast<std::size_t>(robot)]);
  parent_from_solids_.clear();
  solids_from_parent_.clear();
  for (const Pose2& map_from_solid : map_from_solids_) {
    const Pose2 parent_from_solid = parent_from_map * map_from_solid;
    parent_from_solids_.push_back(affine(parent_from_solid));
    solids_from_parent_.push_back(affine(parent_from_solid.inverse()));
  }
  tracer_.place(parent_from_solids_);
}

void StageSet::aim(const Eigen::Vector3f& camera_m) {
  aims_.clear();
  for (const Ball& ball : balls_) {
    const Eigen::Vector3f to =
        parent_from_solids_[static_cast<std::size_t>(ball.solid)] * ball.centre_m - camera_m;
    const float distance_m = to.norm();
    const bool inside = distance_m <= ball.radius_m;
    aims_.push_back({inside ? Eigen::Vector3f::UnitZ() : (to / distance_m).eval(),
                     inside ? static_cast<float>(M_PI) : std::asin(ball.radius_m / distance_m)});
  }
}

bool StageSet::mayShow(const PixelTable::Cone& cone) const {
  if (cone.half_angle_rad < 0.0f) return false;
  for (const Aim& aim : aims_) {
    const float reach_rad = cone.half_angle_rad + aim.half_angle_rad;
    if (reach_rad >= static_cast<float>(M_PI) || cone.axis.dot(aim.direction) >= std::cos(reach_rad))
      return true;
  }
  return false;
}

int StageSet::faceId(int solid, int triangle) const {
  const SolidMesh& mesh = meshes_[static_cast<std::size_t>(solid)];
  return solid * kFacesPerSolid + mesh.face_of_triangle[static_cast<std::size_t>(triangle)];
}

Eigen::Array4f StageSet::colour(int solid, int triangle, const Eigen::Vector3f& point_m) const {
  const auto index = static_cast<std::size_t>(solid);
  const SolidMesh& mesh = meshes_[index];
  const Face& face = mesh.faces[mesh.face_of_triangle[static_cast<std::size_t>(triangle)]];
  const Eigen::Vector3f local = solids_from_parent_[index] * point_m;
  const Eigen::Vector3f local_normal =
      face.round ? Eigen::Vector3f(local.x(), local.y(), 0.0f).normalized() : face.normal;
  const Pose2& map_from_solid = map_from_solids_[index];
  const Eigen::Vector2d flat = map_from_solid.rotation() * local_normal.head<2>().cast<double>();
  const Eigen::Vector3d normal(flat.x(), flat.y(), local_normal.z());

  const double lamp =
      std::max(0.0, normal.dot(light_.sun)) / std::max(0.1 * light_.sun.norm(), light_.sun.z());
  const Eigen::Vector2d place_m = map_from_parent_ * Eigen::Vector2d(point_m.x(), point_m.y());
  const double level = light_.at(place_m, time_s_) * (light_.ambient + (1.0 - light_.ambient) * lamp);
  float mottle = 1.0f;
  if (face.texture > 0.0f) {
    const Eigen::Vector3f cell = local / kMottleM;
    const std::uint32_t seed = seed_ + static_cast<std::uint32_t>(solid);
    mottle +=
        face.texture * (0.7f * valueNoise(cell.x(), cell.y(), cell.z(), seed) +
                        0.4f * valueNoise(3.1f * cell.x(), 3.1f * cell.y(), 3.1f * cell.z(), seed + 77));
  }
  return face.bgr * (static_cast<float>(level) * std::max(0.05f, mottle));
}

}  // namespace omnifleet::synthetic
