#include "tests/unit/tracking/floor_sim.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <opencv2/imgproc.hpp>

namespace omnifleet::sim {
namespace {

Polygon hullOf(const Polygon& points) {
  std::vector<cv::Point2f> in, out;
  for (const auto& p : points) in.emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()));
  cv::convexHull(in, out, false);
  Polygon hull;
  for (const auto& p : out) hull.emplace_back(p.x, p.y);
  if (signedArea(hull) < 0) std::reverse(hull.begin(), hull.end());
  return hull;
}

Polygon placed(const Body& body, const Pose2& target_from_body) {
  Polygon polygon;
  for (const auto& p : body.outline) polygon.push_back(target_from_body * p);
  return polygon;
}

/// Metres on the floor per pixel, radially, at distance ρ from the foot (equidistant lens).
double radialPixel(const Scene& scene, double rho) {
  const double h = scene.camera_height_m;
  return (h * h + rho * rho) / (h * scene.focal_px);
}

/// The same in the tangential direction.
double acrossPixel(const Scene& scene, double rho) {
  const double theta = std::max(0.05, std::atan2(rho, scene.camera_height_m));
  return std::max(rho, 0.02) / (scene.focal_px * theta);
}

Polygon silhouette(const Scene& scene, const Body& body, const Pose2& base_from_map, std::mt19937& rng) {
  Polygon points = placed(body, base_from_map * body.pose);
  const std::size_t n = points.size();
  const double s = scene.camera_height_m / std::max(0.02, scene.camera_height_m - body.height_m);
  for (std::size_t i = 0; i < n; ++i) points.push_back(s * points[i]);
  if (body.shows == Shows::kTop)
    points.erase(points.begin(), points.begin() + static_cast<std::ptrdiff_t>(n));
  std::normal_distribution<double> normal(0.0, scene.noise.vertex_px);
  for (auto& p : points) {
    const double rho = p.norm();
    const Eigen::Vector2d radial = p / std::max(rho, 1e-9), across(-radial.y(), radial.x());
    const double believed =
        scene.camera_height_m *
        std::tan(std::min(1.53, std::atan2(rho, scene.camera_height_m) / scene.noise.focal_scale));
    p = believed * radial + normal(rng) * radialPixel(scene, rho) * radial +
        normal(rng) * acrossPixel(scene, rho) * across;
  }
  return hullOf(points);
}

bool touch(const Polygon& a, const Polygon& b) {
  std::vector<cv::Point2f> pa, pb, both;
  for (const auto& p : a) pa.emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()));
  for (const auto& p : b) pb.emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()));
  return cv::intersectConvexConvex(pa, pb, both, true) > 1e-5F;
}

double unionArea(const std::vector<Polygon>& polygons) {
  constexpr double kCell_m = 0.01;
  double low_x = 1e9, low_y = 1e9, high_x = -1e9, high_y = -1e9;
  for (const auto& polygon : polygons) {
    for (const auto& p : polygon) {
      low_x = std::min(low_x, p.x());
      low_y = std::min(low_y, p.y());
      high_x = std::max(high_x, p.x());
      high_y = std::max(high_y, p.y());
    }
  }
  const auto cells = [&](double length) {
    return std::clamp(static_cast<int>(length / kCell_m) + 3, 3, 3000);
  };
  cv::Mat mask = cv::Mat::zeros(cells(high_y - low_y), cells(high_x - low_x), CV_8U);
  for (const auto& polygon : polygons) {
    std::vector<cv::Point> corners;
    for (const auto& p : polygon) {
      corners.emplace_back(static_cast<int>(std::lround((p.x() - low_x) / kCell_m * 16)),
                           static_cast<int>(std::lround((p.y() - low_y) / kCell_m * 16)));
    }
    cv::fillConvexPoly(mask, corners, 255, cv::LINE_8, 4);
  }
  return cv::countNonZero(mask) * kCell_m * kCell_m;
}

Eigen::Vector2d nearestPoint(const Polygon& polygon) {
  Eigen::Vector2d best(1e9, 1e9);
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector2d a = polygon[i], e = polygon[(i + 1) % polygon.size()] - a;
    const Eigen::Vector2d p = a + std::clamp(-a.dot(e) / std::max(1e-12, e.squaredNorm()), 0.0, 1.0) * e;
    if (p.norm() < best.norm()) best = p;
  }
  return best;
}

/// Groups of silhouettes that touch, directly or through others.
std::vector<std::vector<std::size_t>> blobs(const std::vector<Polygon>& silhouettes) {
  std::vector<std::size_t> group(silhouettes.size());
  std::iota(group.begin(), group.end(), 0);
  for (std::size_t i = 0; i < silhouettes.size(); ++i) {
    for (std::size_t j = i + 1; j < silhouettes.size(); ++j) {
      if (group[i] == group[j] || !touch(silhouettes[i], silhouettes[j])) continue;
      const std::size_t from = group[j], to = group[i];
      for (auto& g : group) g = g == from ? to : g;
    }
  }
  std::vector<std::vector<std::size_t>> result;
  for (std::size_t g = 0; g < group.size(); ++g) {
    std::vector<std::size_t> members;
    for (std::size_t i = 0; i < group.size(); ++i) {
      if (group[i] == g) members.push_back(i);
    }
    if (!members.empty()) result.push_back(members);
  }
  return result;
}

SupportFunction measure(const Scene& scene, const Polygon& hull) {
  SupportFunction support = SupportFunction::of(hull, Eigen::Vector2d::Zero(), 1.0);
  for (std::size_t k = 0; k < support.size(); ++k) {
    const double phi = 2.0 * M_PI * static_cast<double>(k) / static_cast<double>(support.size());
    const Eigen::Vector2d n(std::cos(phi), std::sin(phi));
    const auto at = *std::max_element(hull.begin(), hull.end(),
                                      [&](const auto& a, const auto& b) { return n.dot(a) < n.dot(b); });
    const double rho = at.norm(), along = std::abs(n.dot(at)) / std::max(rho, 1e-9);
    const double pixel = std::hypot(along * radialPixel(scene, rho), (1.0 - along) * acrossPixel(scene, rho));
    support.sigma_m[k] = static_cast<float>(0.4 * pixel + 0.001);
  }
  return support;
}

/// Corners of the top face, tracked from the previous frame to this one.
void addVectors(const Scene& scene, const Scene& before, std::size_t self, std::size_t body,
                const Motion& motion, std::mt19937& rng, ObjectObservation& object) {
  const double s =
      scene.camera_height_m / std::max(0.02, scene.camera_height_m - scene.bodies[body].height_m);
  const Pose2 now = scene.bodies[self].pose.inverse() * scene.bodies[body].pose;
  const Pose2 then = before.bodies[self].pose.inverse() * before.bodies[body].pose;
  std::normal_distribution<double> normal(0.0, 0.2);
  const auto& outline = scene.bodies[body].outline;
  const std::size_t every = std::max<std::size_t>(1, outline.size() / 6);
  for (std::size_t i = 0; i < outline.size(); i += every) {
    const Eigen::Vector2d from = s * (then * outline[i]), to = s * (now * outline[i]);
    const double pixel = radialPixel(scene, to.norm());
    FlowVector vector;
    vector.from_px.setZero();  // pixels are not used
    vector.to_px.setZero();
    vector.from_m = from.cast<float>();
    vector.to_m = (to + pixel * Eigen::Vector2d(normal(rng), normal(rng))).cast<float>();
    vector.residual_m = vector.to_m - (motion.previous_from_current.inverse() * from).cast<float>();
    object.vectors.push_back(vector);
  }
}

ObjectObservation observe(const Scene& scene, const std::vector<Polygon>& silhouettes,
                          const std::vector<std::size_t>& members) {
  ObjectObservation object;
  Polygon all;
  std::vector<Polygon> parts;
  for (const std::size_t i : members) {
    all.insert(all.end(), silhouettes[i].begin(), silhouettes[i].end());
    parts.push_back(silhouettes[i]);
    const Eigen::Vector2d nearest = nearestPoint(silhouettes[i]);
    if (object.contact_m.isZero() || nearest.norm() < object.contact_m.norm()) object.contact_m = nearest;
  }
  object.hull_m = hullOf(all);
  object.centroid_m = centroid(object.hull_m);
  object.supports = measure(scene, object.hull_m);
  object.solidity = parts.size() == 1 ? 1.0 : std::min(1.0, unionArea(parts) / signedArea(object.hull_m));
  return object;
}

void fillWithFloor(Scan& scan) {
  constexpr std::size_t kRays = 360;
  scan.range_m.assign(kRays, 3.0F);
  scan.sigma_m.assign(kRays, 0.01F);
  scan.label.assign(kRays, RayLabel::kFloorEnd);
  scan.object.assign(kRays, 0);
}

/// @param label of the rays that hit a silhouette @param label_of object label of each silhouette
void castRays(const std::vector<Polygon>& silhouettes, RayLabel label,
              const std::vector<std::uint16_t>& label_of, Scan& scan) {
  const std::size_t rays = scan.range_m.size();
  for (std::size_t r = 0; r < rays; ++r) {
    const double bearing = 2.0 * M_PI * static_cast<double>(r) / static_cast<double>(rays);
    const Eigen::Vector2d ray(std::cos(bearing), std::sin(bearing));
    for (std::size_t i = 0; i < silhouettes.size(); ++i) {
      for (std::size_t v = 0; v < silhouettes[i].size(); ++v) {
        const Eigen::Vector2d a = silhouettes[i][v], e = silhouettes[i][(v + 1) % silhouettes[i].size()] - a;
        const double det = ray.y() * e.x() - ray.x() * e.y();
        if (std::abs(det) < 1e-12) continue;
        const double range = (a.y() * e.x() - a.x() * e.y()) / det,
                     along = (ray.x() * a.y() - ray.y() * a.x()) / det;
        if (range <= 0 || along < 0 || along > 1 || range >= scan.range_m[r]) continue;
        scan.range_m[r] = static_cast<float>(range);
        scan.label[r] = label;
        scan.object[r] = label_of[i];
      }
    }
  }
}

Motion ownMotion(const Scene& scene, const Scene& before, std::size_t self, int frame, std::mt19937& rng) {
  Motion motion;
  std::normal_distribution<double> normal(0.0, 1.0);
  motion.valid = true;
  motion.since_ns = static_cast<TimeNs>((frame - 1) * scene.step_s * 1e9);
  motion.previous_from_current = before.bodies[self].pose.inverse() * scene.bodies[self].pose;
  const double length = motion.previous_from_current.translation().norm();
  const double turned = std::abs(motion.previous_from_current.theta_rad);
  const double sigma_m = scene.noise.wheels * length + 1e-5,
               sigma_rad = length + turned > 0 ? scene.noise.turn_rad + scene.noise.wheels * turned : 1e-5;
  motion.previous_from_current.x_m += sigma_m * normal(rng);
  motion.previous_from_current.theta_rad += sigma_rad * normal(rng);
  motion.covariance = Eigen::Vector3d(sigma_m * sigma_m, 1e-8, sigma_rad * sigma_rad).asDiagonal();
  return motion;
}

}  // namespace

Body round(const std::string& name, double radius_m, double height_m, const Pose2& pose) {
  Body body;
  body.name = name;
  body.outline = circlePolygon(Eigen::Vector2d::Zero(), radius_m, 48);
  body.height_m = height_m;
  body.pose = pose;
  return body;
}

Body box(const std::string& name, double length_m, double width_m, double height_m, const Pose2& pose) {
  Body body = round(name, 0.1, height_m, pose);
  const double a = 0.5 * length_m, b = 0.5 * width_m;
  body.outline = {{-a, -b}, {a, -b}, {a, b}, {-a, b}};
  return body;
}

double gap(const Body& a, const Body& b) {
  const Polygon pa = placed(a, a.pose), pb = placed(b, b.pose);
  if (touch(pa, pb)) return 0.0;
  double least = std::numeric_limits<double>::infinity();
  const auto scan = [&](const Polygon& points, const Polygon& edges) {
    for (const auto& p : points) {
      for (std::size_t i = 0; i < edges.size(); ++i) {
        const Eigen::Vector2d e = edges[(i + 1) % edges.size()] - edges[i];
        const double along = std::clamp((p - edges[i]).dot(e) / e.squaredNorm(), 0.0, 1.0);
        least = std::min(least, (p - edges[i] - along * e).norm());
      }
    }
  };
  scan(pa, pb);
  scan(pb, pa);
  return least;
}

void Scene::advance() {
  for (Body& body : bodies) {
    const double turn = body.w_radps * step_s;
    body.pose = body.pose * Pose2{body.v_mps * step_s * std::cos(0.5 * turn),
                                  body.v_mps * step_s * std::sin(0.5 * turn), turn};
  }
}

void Scene::steerClear(double speed_mps, std::mt19937& rng) {
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  for (std::size_t i = 0; i < bodies.size() && bodies[i].robot; ++i) {
    Body ahead = bodies[i];
    ahead.pose = ahead.pose * Pose2{0.15, 0.0, 0.0};
    bool free = ahead.pose.translation().norm() < 2.0;
    for (std::size_t j = 0; j < bodies.size(); ++j) free = free && (j == i || gap(ahead, bodies[j]) > 0.12);
    if (free) {
      bodies[i].v_mps = speed_mps;
      bodies[i].w_radps = std::clamp(bodies[i].w_radps + 0.3 * uniform(rng), -0.5, 0.5);
    } else {
      bodies[i].v_mps = 0.0;
      bodies[i].w_radps = bodies[i].w_radps >= 0 ? 1.2 : -1.2;
    }
  }
}

LocalMap localMapOf(const Scene& scene, std::size_t self, const Scene* before, int frame, std::mt19937& rng,
                    std::vector<std::vector<std::size_t>>* blob_bodies) {
  LocalMap map;
  map.robot = scene.bodies[self].name;
  map.acquired_ns = static_cast<TimeNs>(frame * scene.step_s * 1e9);
  map.sequence = static_cast<std::uint32_t>(frame);
  map.camera_height_m = scene.camera_height_m;
  if (before) map.motion = ownMotion(scene, *before, self, frame, rng);
  const Pose2 base_from_map = scene.bodies[self].pose.inverse();
  std::vector<Polygon> silhouettes, hints;
  std::vector<std::size_t> body_of;
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    if (i == self) continue;
    const Polygon seen = silhouette(scene, scene.bodies[i], base_from_map, rng);
    if (nearestPoint(seen).norm() > scene.sight_m) continue;
    if (scene.bodies[i].shows == Shows::kHint) {
      hints.push_back(seen);
      continue;
    }
    silhouettes.push_back(seen);
    body_of.push_back(i);
  }
  std::vector<std::uint16_t> label_of(silhouettes.size(), 0);
  if (blob_bodies) blob_bodies->clear();
  for (const auto& members : blobs(silhouettes)) {
    ObjectObservation object = observe(scene, silhouettes, members);
    object.label = static_cast<std::uint16_t>(map.objects.size() + 1);
    if (blob_bodies) blob_bodies->emplace_back();
    for (const std::size_t m : members) {
      label_of[m] = object.label;
      if (blob_bodies) blob_bodies->back().push_back(body_of[m]);
      if (before) addVectors(scene, *before, self, body_of[m], map.motion, rng, object);
    }
    map.objects.push_back(object);
  }
  fillWithFloor(map.scan);
  castRays(hints, RayLabel::kUndecided, std::vector<std::uint16_t>(hints.size(), 0), map.scan);
  castRays(silhouettes, RayLabel::kUnknown, label_of, map.scan);
  return map;
}

std::vector<PoseEstimate> publish(const Scene& scene, int frame, std::mt19937& rng) {
  std::normal_distribution<double> normal(0.0, 1.0);
  std::vector<PoseEstimate> poses;
  const Noise& noise = scene.noise;
  for (const Body& body : scene.bodies) {
    if (!body.robot || !body.publishes || !body.declared) continue;
    PoseEstimate pose;
    pose.robot = body.name;
    pose.acquired_ns = static_cast<TimeNs>(frame * scene.step_s * 1e9);
    pose.valid = true;
    pose.map_from_base = body.pose * Pose2{noise.pose_m * normal(rng), noise.pose_m * normal(rng),
                                           noise.pose_rad * normal(rng)};
    pose.covariance = Eigen::Vector3d(noise.pose_m * noise.pose_m, noise.pose_m * noise.pose_m,
                                      noise.pose_rad * noise.pose_rad)
                          .asDiagonal();
    poses.push_back(pose);
  }
  return poses;
}

}  // namespace omnifleet::sim
