#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <vector>

#include "synthetic/solid_mesh.h"

namespace omnifleet::synthetic {

/// Sixteen rays from one point, and what they hit.
struct alignas(64) RayPacket {
  static constexpr int kSize = 16;
  float x[kSize], y[kSize], z[kSize];  ///< directions, any positive length
  std::uint32_t wanted = 0;            ///< bit per ray
  // Results; solid −1: nothing.
  float distance[kSize];  ///< in units of the direction's length
  int solid[kSize];
  int triangle[kSize];
};

/// Solids that move as wholes, on Embree 3: one mesh per solid, instanced where it stands.
class Tracer {
 public:
  /// Throws std::runtime_error when Embree fails.
  explicit Tracer(const std::vector<SolidMesh>& meshes);
  ~Tracer();
  Tracer(const Tracer&) = delete;
  Tracer& operator=(const Tracer&) = delete;

  /// Where the solids stand, in the frame of the rays; their z axes stay upright in map.
  void place(const std::vector<Eigen::Affine3f>& frame_from_solids);

  void trace(const Eigen::Vector3f& origin_m, RayPacket& rays) const;

 private:
  struct Scenes;
  std::unique_ptr<Scenes> scenes_;
};

}  // namespace omnifleet::synthetic
