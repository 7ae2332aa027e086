#include "synthetic/solid_mesh.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::synthetic {
namespace {

constexpr int kRoundSides = 256;        // the error of a 15 cm cylinder is 11 µm
constexpr float kPlateStepM = 0.0005f;  // vertical distance of stacked plates

Eigen::Array4f bgrOf(const Rgb& rgb) {
  return {float(rgb[2]), float(rgb[1]), float(rgb[0]), 0.0f};
}

Eigen::Vector3f raised(const Eigen::Vector2d& p, float z_m) {
  return {static_cast<float>(p.x()), static_cast<float>(p.y()), z_m};
}

void addTriangle(SolidMesh& mesh, std::uint32_t a, std::uint32_t b, std::uint32_t c, std::size_t face) {
  mesh.triangles.push_back({a, b, c});
  mesh.face_of_triangle.push_back(static_cast<std::uint16_t>(face));
}

/// Adds a convex polygon at a height.
void addPlate(SolidMesh& mesh, const Polygon& outline, float z_m, const Face& face) {
  const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
  for (const Eigen::Vector2d& p : outline) mesh.vertices.push_back(raised(p, z_m));
  for (std::uint32_t i = 1; i + 1 < outline.size(); ++i) {
    addTriangle(mesh, first, first + i, first + i + 1, mesh.faces.size());
  }
  mesh.faces.push_back(face);
}

/// Sides and top of a convex prism. A round one has a single side face.
SolidMesh prism(const Polygon& outline, double height_m, Face face, bool round) {
  SolidMesh mesh;
  mesh.height_m = static_cast<float>(height_m);
  const auto n = static_cast<std::uint32_t>(outline.size());
  for (const Eigen::Vector2d& p : outline) {
    mesh.vertices.push_back(raised(p, 0.0f));
    mesh.vertices.push_back(raised(p, mesh.height_m));
    mesh.radius_m = std::max(mesh.radius_m, static_cast<float>(p.norm()));
  }
  face.round = round;
  for (std::uint32_t i = 0; i < n; ++i) {
    const std::uint32_t next = (i + 1) % n;
    if (!round || i == 0) {
      const Eigen::Vector2d along = (outline[next] - outline[i]).normalized();
      face.normal = raised({along.y(), -along.x()}, 0.0f);
      mesh.faces.push_back(face);
    }
    addTriangle(mesh, 2 * i, 2 * next, 2 * next + 1, mesh.faces.size() - 1);
    addTriangle(mesh, 2 * i, 2 * next + 1, 2 * i + 1, mesh.faces.size() - 1);
  }
  face.round = false;
  face.normal = Eigen::Vector3f::UnitZ();
  addPlate(mesh, outline, mesh.height_m, face);
  return mesh;
}

Polygon rectangle(const Eigen::Vector2d& centre, const Eigen::Vector2d& size) {
  const Eigen::Vector2d h = 0.5 * size;
  return {centre - h, centre + Eigen::Vector2d(h.x(), -h.y()), centre + h,
          centre + Eigen::Vector2d(-h.x(), h.y())};
}

void addMarkers(SolidMesh& mesh, const std::string& robot, const dataset::MarkerSet& markers) {
  const auto found = markers.robots.find(robot);
  if (found == markers.robots.end()) return;
  const float z_m = std::max(static_cast<float>(markers.height_m), mesh.height_m + kPlateStepM);
  const auto plate = [&](const Eigen::Vector2d& centre, const Eigen::Vector2d& size, const Rgb& rgb,
                         int layer) {
    Face face;
    face.bgr = bgrOf(rgb);
    addPlate(mesh, rectangle(centre, size), z_m + static_cast<float>(layer) * kPlateStepM, face);
  };
  if (markers.kind == dataset::MarkerKind::kPatches) {
    plate(markers.team_offset_m, markers.patch_size_m, markers.team, 0);
    plate(markers.individual_offset_m, markers.patch_size_m, found->second.individual, 0);
  } else {
    plate(Eigen::Vector2d::Zero(), markers.cover_size_m, found->second.cover, 0);
    plate(markers.tail_offset_m, markers.tail_size_m, found->second.tail, 1);
    plate(markers.head_offset_m, markers.head_size_m, found->second.head, 2);
  }
  for (const Eigen::Vector3f& v : mesh.vertices) {
    mesh.radius_m = std::max(mesh.radius_m, v.head<2>().norm());
    mesh.height_m = std::max(mesh.height_m, v.z());
  }
}

Face plainFace(const Rgb& rgb, double texture) {
  Face face;
  face.bgr = bgrOf(rgb);
  face.texture = static_cast<float>(texture);
  return face;
}

}  // namespace

SolidMesh meshOf(const Solid& solid) {
  const Face face = plainFace(solid.rgb, solid.texture);
  if (solid.kind == SolidKind::kBox) return prism(solid.footprintAt(Pose2{}), solid.height_m, face, false);
  return prism(circlePolygon(Eigen::Vector2d::Zero(), solid.radius_m, kRoundSides), solid.height_m, face,
               true);
}

SolidMesh meshOf(const ArenaRobot& robot, const std::optional<dataset::MarkerSet>& markers) {
  const bool round = robot.body.radius_m > 0.0;
  const Polygon outline = round ? circlePolygon(Eigen::Vector2d::Zero(), robot.body.radius_m, kRoundSides)
                                : robot.body.footprint_m;
  SolidMesh mesh = prism(outline, robot.body.height_m, plainFace(robot.rgb, robot.texture), round);
  if (markers) addMarkers(mesh, robot.name, *markers);
  return mesh;
}

}  // namespace omnifleet::synthetic
