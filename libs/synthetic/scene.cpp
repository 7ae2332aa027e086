#include "synthetic/scene.h"

#include <algorithm>
#include <cmath>

#include "synthetic/yaml.h"

namespace omnifleet::synthetic {
namespace {

constexpr int kCircleVertices = 96;

/// Radius of the regular polygon with the area of the circle.
double radiusOfEqualArea(double radius_m) {
  const double step = 2.0 * M_PI / kCircleVertices;
  return radius_m * std::sqrt(step / std::sin(step));
}

}  // namespace

Floor Floor::read(const options::Section& section) {
  Floor floor;
  section.read("size_m", floor.size_m, {0.5, 100.0});
  readRgb(section, "rgb", floor.rgb);
  section.read("clouds", floor.clouds, {0.0, 0.5});
  section.read("cloud_size_m", floor.cloud_size_m, {0.02, 10.0});
  section.read("texture", floor.texture, {0.0, 0.5});
  section.read("texture_size_m", floor.texture_size_m, {0.001, 1.0});
  section.read("grid_m", floor.grid_m, {0.0, 10.0});
  section.read("grid_width_m", floor.grid_width_m, {0.0005, 0.5});
  readRgb(section, "grid_rgb", floor.grid_rgb);
  section.read("tile_variation", floor.tile_variation, {0.0, 0.5});
  section.finish();
  return floor;
}

Light Light::read(const options::Section& section) {
  Light light;
  section.read("level", light.level, {0.05, 3.0});
  section.read("gradient_per_m", light.gradient_per_m, {-1.0, 1.0});
  section.read("spot", light.spot, {-1.0, 2.0});
  section.read("spot_m", light.spot_m, {-100.0, 100.0});
  section.read("spot_size_m", light.spot_size_m, {0.05, 100.0});
  section.read("flicker", light.flicker, {0.0, 0.9});
  section.read("flicker_period_s", light.flicker_period_s, options::kPositive);
  section.read("ambient", light.ambient, {0.0, 1.0});
  section.read("sun", light.sun, {-10.0, 10.0});
  section.read("contact_shadow", light.contact_shadow, {0.0, 1.0});
  section.read("contact_shadow_m", light.contact_shadow_m, {0.005, 1.0});
  section.read("cast_shadow", light.cast_shadow, {0.0, 1.0});
  section.read("cast_softness", light.cast_softness, {0.01, 2.0});
  if (light.cast_shadow > 0.0 && light.sun.z() <= 0.0)
    section.fail("sun", "must have z > 0 when cast_shadow is set");
  if (light.sun.norm() < 1e-6) section.fail("sun", "must not be zero");
  section.finish();
  return light;
}

double Light::at(const Eigen::Vector2d& place_m, double time_s) const {
  const double spot_now =
      spot * std::exp(-(place_m - spot_m).squaredNorm() / (2.0 * spot_size_m * spot_size_m));
  const double still = level + gradient_per_m.dot(place_m) + spot_now;
  return std::max(0.05, still) * (1.0 + flicker * std::sin(2.0 * M_PI * time_s / flicker_period_s));
}

Polygon Solid::footprintAt(const Pose2& map_from_solid_then) const {
  Polygon outline = circlePolygon(Eigen::Vector2d::Zero(), radiusOfEqualArea(radius_m), kCircleVertices);
  if (kind == SolidKind::kBox) {
    const double x = 0.5 * size_m.x(), y = 0.5 * size_m.y();
    outline = {{-x, -y}, {x, -y}, {x, y}, {-x, y}};
  }
  for (Eigen::Vector2d& vertex : outline) vertex = map_from_solid_then * vertex;
  return outline;
}

double Solid::distance(const Eigen::Vector2d& place_m, const Pose2& map_from_solid_then) const {
  return distance(map_from_solid_then.inverse() * place_m);
}

double Solid::distance(const Eigen::Vector2d& place_in_solid_m) const {
  if (kind == SolidKind::kCylinder) return place_in_solid_m.norm() - radius_m;
  const Eigen::Vector2d beyond = place_in_solid_m.cwiseAbs() - 0.5 * size_m;
  return beyond.cwiseMax(0.0).norm() + std::min(0.0, beyond.maxCoeff());
}

Solid Solid::read(const options::Section& section) {
  Solid solid;
  std::string kind = "box";
  section.require("kind", kind, std::vector<std::string>{"box", "cylinder"});
  solid.kind = kind == "box" ? SolidKind::kBox : SolidKind::kCylinder;
  if (!section.has("pose")) section.fail("pose", "is required: [x m, y m, angle rad]");
  readPose(section, "pose", solid.map_from_solid);
  if (solid.kind == SolidKind::kBox) {
    section.require("size_m", solid.size_m, options::Range{0.01, 100.0});
  } else {
    section.require("radius_m", solid.radius_m, options::Range{0.01, 10.0});
  }
  section.require("height_m", solid.height_m, options::Range{0.005, 10.0});
  readRgb(section, "rgb", solid.rgb);
  section.read("texture", solid.texture, {0.0, 0.9});
  section.read("fixed", solid.fixed);
  section.finish();
  return solid;
}

ImageFormation ImageFormation::read(const options::Section& section) {
  ImageFormation image;
  section.read("gain", image.gain, {0.01, 10.0});
  section.read("noise", image.noise, {0.0, 50.0});
  section.read("shot_noise", image.shot_noise, {0.0, 5.0});
  section.read("blur_px", image.blur_px, {0.0, 10.0});
  section.read("vignetting", image.vignetting, {0.0, 0.95});
  section.read("edge_samples", image.edge_samples, {1, 16});
  section.finish();
  return image;
}

}  // namespace omnifleet::synthetic
