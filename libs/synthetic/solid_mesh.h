#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "synthetic/arena.h"

namespace omnifleet::synthetic {

/// A flat face, or the round side of a cylinder, whose normal points away from the z axis.
struct Face {
  Eigen::Array4f bgr = Eigen::Array4f::Zero();  ///< grey levels in full light
  Eigen::Vector3f normal = Eigen::Vector3f::UnitZ();
  bool round = false;
  float texture = 0.0f;
};

/// Triangles of one solid in its own frame. It stands on z = 0 and has no bottom.
struct SolidMesh {
  std::vector<Eigen::Vector3f> vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::vector<std::uint16_t> face_of_triangle;
  std::vector<Face> faces;
  float radius_m = 0.0f;  ///< radius of a circle about the z axis that contains the solid
  float height_m = 0.0f;
};

SolidMesh meshOf(const Solid& solid);
/// Body of a robot, with its markers as plates at the height of the markers.
SolidMesh meshOf(const ArenaRobot& robot, const std::optional<dataset::MarkerSet>& markers);

}  // namespace omnifleet::synthetic
