#include "tests/raycast/adaptive_render.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/core/utility.hpp>

#include "tests/raycast/random.h"
#include "tests/raycast/ray_scene.h"
#include "tests/raycast/value_noise.h"

namespace omnifleet::raycast {
namespace {

using Vector = Eigen::Vector3d;

constexpr int kTones = 8192;        // entries of the table
constexpr double kMostLight = 2.0;  // brighter light saturates

/// What the ray through the middle of a pixel meets.
struct Sample {
  bool is_seen = false;  ///< inside of the image circle
  const Solid* solid = nullptr;
  Eigen::Vector3f normal = Eigen::Vector3f::Zero(), radiance = Eigen::Vector3f::Zero();
};

/// True if an edge between surfaces or colours may pass between two pixels.
bool differs(const Sample& a, const Sample& b) {
  constexpr float kSameSide = 0.9F;     // cosine; cylinders bend by less from pixel to pixel
  constexpr float kSameColour = 0.06F;  // relative
  if (!a.is_seen || !b.is_seen) return false;
  if (a.solid != b.solid || a.normal.dot(b.normal) < kSameSide) return true;
  if (a.solid == nullptr) return false;
  return (a.radiance - b.radiance).cwiseAbs().maxCoeff() > kSameColour * a.radiance.maxCoeff();
}

/// Standard normal numbers, computed once.
const std::vector<float>& normals() {
  static const std::vector<float> table = [] {
    Random random(1);
    std::vector<float> numbers(1U << 16U);
    for (float& number : numbers) number = static_cast<float>(random.normal(1.0));
    return numbers;
  }();
  return table;
}

}  // namespace

/// The ray through the middle of a pixel, which does not depend on the robot's pose.
struct AdaptiveRenderer::PixelRay {
  Eigen::Vector3d along = Eigen::Vector3d::Zero();  ///< in the frame of the camera; z upwards
  double reaches = -1.0;  ///< share of the light that vignetting leaves; < 0: outside
  int bearing = 0;        ///< number of the interval of bearings
};

/// One image.
class AdaptiveRenderer::Exposure {
 public:
  Exposure(const AdaptiveRenderer& renderer, const Pose2& map_from_camera, const std::vector<Solid>& robots,
           unsigned frame)
      : renderer_(renderer),
        solids_(placedIn(renderer.room_, robots)),
        map_from_camera_(map_from_camera.rotation()),
        from_(map_from_camera.x_m, map_from_camera.y_m, renderer.camera_.position_m.z()),
        frame_(frame),
        samples_(renderer.rays_.size()) {
    const Pose2 camera_from_map = map_from_camera.inverse();
    for (const Placed& solid : solids_) add(solid, camera_from_map * solid.middle_m);
  }

  cv::Mat3b image() {
    const lens::CameraModel& camera = renderer_.camera_;
    cv::Mat3b image(camera.image_height_px, camera.image_width_px, cv::Vec3b(0, 0, 0));
    const cv::Range rows(0, image.rows);
    cv::parallel_for_(rows, [&](const cv::Range& part) {
      for (int v = part.start; v < part.end; ++v)
        for (int u = 0; u < image.cols; ++u) expose(u, v);
    });
    cv::parallel_for_(rows, [&](const cv::Range& part) {
      for (int v = part.start; v < part.end; ++v) develop(v, image);
    });
    return image;
  }

 private:
  /// Lists a solid under each interval of bearings that it may appear in.
  void add(const Placed& solid, const Eigen::Vector2d& middle) {
    const double range = middle.norm(), reach = std::sqrt(solid.reach2_m2), step = 2.0 * M_PI / kBearings;
    const double half = range > reach ? std::asin(reach / range) : M_PI;
    const double bearing = std::atan2(middle.y(), middle.x());
    for (int k = 0; k < kBearings; ++k)
      if (std::abs(wrapAngle((k + 0.5) * step - bearing)) < half + 0.51 * step)
        by_bearing_[static_cast<std::size_t>(k)].push_back(solid);
  }

  std::size_t index(int u, int v) const {
    return static_cast<std::size_t>(v * renderer_.camera_.image_width_px + u);
  }

  Sample sampleOf(const std::vector<Placed>& solids, const PixelRay& ray, unsigned chance) const {
    Sample sample;
    Vector along = ray.along;
    along.head<2>() = map_from_camera_ * ray.along.head<2>();
    const Room& room = renderer_.room_;
    const Hit hit = firstHit(solids, from_, along);
    sample.is_seen = true;
    sample.solid = hit.solid;
    sample.normal = hit.normal.cast<float>();
    sample.radiance =
        (room.light * ray.reaches *
         radianceOf(room, solids_, hit, from_, along, chance, 1.0 / renderer_.camera_.focal_px.x()))
            .cast<float>();
    return sample;
  }

  void expose(int u, int v) {
    const std::size_t at = index(u, v);
    const PixelRay& ray = renderer_.rays_[at];
    if (ray.reaches < 0.0) return;
    samples_[at] = sampleOf(by_bearing_[static_cast<std::size_t>(ray.bearing)], ray,
                            mixed(static_cast<unsigned>(at)) ^ mixed(frame_ * 8191U));
  }

  bool isEdge(int u, int v) const {
    const Sample& own = samples_[index(u, v)];
    const auto isUnlike = [&](int x, int y) { return differs(own, samples_[index(x, y)]); };
    return (u > 0 && isUnlike(u - 1, v)) || (v > 0 && isUnlike(u, v - 1)) ||
           (u + 1 < renderer_.camera_.image_width_px && isUnlike(u + 1, v)) ||
           (v + 1 < renderer_.camera_.image_height_px && isUnlike(u, v + 1));
  }

  Eigen::Vector3f radianceAt(int u, int v) const {
    const Sample& own = samples_[index(u, v)];
    if (!isEdge(u, v)) return own.radiance;
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    int seen = 0;
    for (const double y : {-0.25, 0.25}) {
      for (const double x : {-0.25, 0.25}) {
        const PixelRay ray = renderer_.rayAt(u + x, v + y);
        if (ray.reaches < 0.0) continue;
        ++seen;
        sum += sampleOf(solids_, ray,
                        mixed(static_cast<unsigned>(4 * index(u, v)) + static_cast<unsigned>(seen)) ^
                            mixed(frame_ * 8191U))
                   .radiance;
      }
    }
    return seen > 0 ? Eigen::Vector3f(sum / static_cast<float>(seen)) : own.radiance;
  }

  void develop(int v, cv::Mat3b& image) const {
    const std::vector<float>& noise = normals();
    const auto sigma = static_cast<float>(renderer_.room_.noise);
    std::size_t next = mixed(renderer_.room_.seed) ^ mixed(frame_ * 4099U + static_cast<unsigned>(v));
    for (int u = 0; u < image.cols; ++u) {
      if (!samples_[index(u, v)].is_seen) continue;
      const Eigen::Vector3f radiance = radianceAt(u, v);
      for (int c = 0; c < 3; ++c)
        image(v, u)[2 - c] = cv::saturate_cast<std::uint8_t>(renderer_.toneAt(radiance[c]) +
                                                             sigma * noise[++next % noise.size()]);
    }
  }

  const AdaptiveRenderer& renderer_;
  std::vector<Placed> solids_;
  std::array<std::vector<Placed>, kBearings> by_bearing_;
  Eigen::Matrix2d map_from_camera_;
  Vector from_;
  unsigned frame_;
  std::vector<Sample> samples_;
};

AdaptiveRenderer::AdaptiveRenderer(const Room& room, const lens::CameraModel& camera)
    : room_(room), camera_(camera), tones_(kTones + 1) {
  for (std::size_t k = 0; k < tones_.size(); ++k)
    tones_[k] = static_cast<float>(toneOf(room, kMostLight * static_cast<double>(k) / kTones));
  for (int v = 0; v < camera.image_height_px; ++v)
    for (int u = 0; u < camera.image_width_px; ++u) rays_.push_back(rayAt(u, v));
}

AdaptiveRenderer::~AdaptiveRenderer() = default;

AdaptiveRenderer::PixelRay AdaptiveRenderer::rayAt(double u, double v) const {
  const Eigen::Vector2d off = Eigen::Vector2d(u, v) - camera_.principal_point_px;
  const double radius = off.norm(), angle = angleAt(camera_, radius), off_axis = angle / (0.5 * M_PI);
  PixelRay ray;
  if (angle < 0.0) return ray;
  const Eigen::Vector2d ahead =
      Eigen::Vector2d(-off.y(), -off.x()) * (std::sin(angle) / std::max(1e-9, radius));
  ray.along = {ahead.x(), ahead.y(), -std::cos(angle)};
  ray.reaches = 1.0 - room_.vignette * off_axis * off_axis;
  const double turns = std::atan2(ahead.y(), ahead.x()) / (2.0 * M_PI);
  ray.bearing = std::min(kBearings - 1, static_cast<int>(kBearings * (turns - std::floor(turns))));
  return ray;
}

float AdaptiveRenderer::toneAt(float linear) const {
  const float place = std::clamp(linear / static_cast<float>(kMostLight), 0.0F, 0.9999F) * kTones;
  const auto k = static_cast<std::size_t>(place);
  return tones_[k] + (place - static_cast<float>(k)) * (tones_[k + 1] - tones_[k]);
}

cv::Mat3b AdaptiveRenderer::render(const Pose2& map_from_camera, const std::vector<Solid>& robots,
                                   unsigned frame) const {
  return Exposure(*this, map_from_camera, robots, frame).image();
}

}  // namespace omnifleet::raycast
