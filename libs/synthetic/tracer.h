#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <vector>

#include "synthetic/solid_mesh.h"

namespace omnifleet::synthetic {

/// Sixteen rays from one point, and their hits.
struct alignas(64) RayPacket {
  static constexpr int kSize = 16;
  float x[kSize], y[kSize], z[kSize];  ///< directions, any positive length
  std::uint32_t wanted = 0;            ///< one bit per ray
  // Results; solid is −1 without a hit.
  float distance[kSize];  ///< in units of the length of the direction
  int solid[kSize];
  int triangle[kSize];
};

/// Rigid moving solids in Embree 3: one mesh per solid, instanced at its pose.
class Tracer {
 public:
  /// Throws std::runtime_error when Embree fails.
  explicit Tracer(const std::vector<SolidMesh>& meshes);
  ~Tracer();
  Tracer(const Tracer&) = delete;
  Tracer& operator=(const Tracer&) = delete;

  /// Sets the poses of the solids in the frame of the rays. Their z axes must stay vertical.
  void place(const std::vector<Eigen::Affine3f>& frame_from_solids);

  void trace(const Eigen::Vector3f& origin_m, RayPacket& rays) const;

 private:
  struct Scenes;
  std::unique_ptr<Scenes> scenes_;
};

}  // namespace omnifleet::synthetic
