#pragma once

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

#include "dataset/markers.h"
#include "geometry/pose2.h"
#include "lens/camera.h"

namespace omnifleet::markers {

/// What light, lens and camera do to a painted image.
struct Imaging {
  double gain = 1.0;                 ///< of the brightness
  double noise = 0.0;                ///< grey levels, σ of Gaussian noise per channel
  double blur_px = 0.0;              ///< σ of the lens
  int jpeg_quality = 0;              ///< 0: not compressed
  double uneven = 0.0;               ///< share by which the light falls from the left to the right border
  dataset::Rgb cast{255, 255, 255};  ///< colour of the light
  int seed = 1;                      ///< of the noise
  bool tone_curve = false;           ///< mixes and blurs linear light, then encodes it with a gamma of 2.2
};

/// The robot below a marker.
enum class Body {
  kPlate,    ///< a dark plate around the marker, larger by 4 cm on each side
  kFrame,    ///< a dark rim of 1 cm around the marker, side faces down to the floor
  kBox,      ///< as large as the marker, side faces down to the floor
  kFloating  ///< only the marker
};

/// Renders images with exact ground truth. Each outline is projected by the camera model and sampled at 8 × 8
/// points per pixel, later outlines over earlier ones.
class Painter {
 public:
  explicit Painter(const lens::CameraModel& model, const dataset::Rgb& floor = {165, 160, 150})
      : camera(model), floor_(floor) {}

  void clear() { shapes_.clear(); }

  /// A polygon on the plane of this height, corners in the frame of the pose.
  void polygon(const Pose2& pose, double height_m, const std::vector<Eigen::Vector2d>& corners,
               const dataset::Rgb& rgb) {
    std::vector<Eigen::Vector3d> points;
    for (const Eigen::Vector2d& corner : corners) {
      const Eigen::Vector2d p = pose * corner;
      points.emplace_back(p.x(), p.y(), height_m);
    }
    face(points, rgb);
  }

  void rectangle(const Pose2& pose, double height_m, const Eigen::Vector2d& offset,
                 const Eigen::Vector2d& size, const dataset::Rgb& rgb) {
    polygon(pose, height_m, cornersOf(offset, size), rgb);
  }

  /// Side faces of a box from the floor up to a height.
  void sides(const Pose2& pose, double height_m, const Eigen::Vector2d& offset, const Eigen::Vector2d& size,
             const dataset::Rgb& rgb) {
    const auto corners = cornersOf(offset, size);
    for (std::size_t i = 0; i < 4; ++i) {
      const Eigen::Vector2d a = pose * corners[i], b = pose * corners[(i + 1) % 4];
      const double lit = 0.6 + 0.1 * static_cast<double>(i);
      const auto shaded = [lit](std::uint8_t c) { return static_cast<std::uint8_t>(lit * c); };
      face({{a.x(), a.y(), 0}, {b.x(), b.y(), 0}, {b.x(), b.y(), height_m}, {a.x(), a.y(), height_m}},
           {shaded(rgb[0]), shaded(rgb[1]), shaded(rgb[2])});
    }
  }

  /// The marker alone, on a plane of this height.
  void marker(const dataset::MarkerSet& set, const std::string& name, const Pose2& pose, double height_m,
              double scale = 1.0) {
    const dataset::RobotColours& c = set.robots.at(name);
    if (set.kind == dataset::MarkerKind::kPatches) {
      rectangle(pose, height_m, scale * set.team_offset_m, scale * set.patch_size_m, set.team);
      rectangle(pose, height_m, scale * set.individual_offset_m, scale * set.patch_size_m, c.individual);
    } else {
      rectangle(pose, height_m, {0, 0}, scale * set.cover_size_m, c.cover);
      rectangle(pose, height_m, scale * set.tail_offset_m, scale * set.tail_size_m, c.tail);
      rectangle(pose, height_m, scale * set.head_offset_m, scale * set.head_size_m, c.head);
    }
  }

  void robot(const dataset::MarkerSet& set, const std::string& name, const Pose2& pose,
             Body body = Body::kPlate) {
    const dataset::Rgb dark{30, 30, 30}, side{70, 65, 60};
    const bool patches = set.kind == dataset::MarkerKind::kPatches;
    const Eigen::Vector2d middle = patches
                                       ? Eigen::Vector2d(0.5 * (set.team_offset_m + set.individual_offset_m))
                                       : Eigen::Vector2d(0, 0);
    const Eigen::Vector2d size =
        patches ? Eigen::Vector2d((set.team_offset_m - set.individual_offset_m).cwiseAbs() + set.patch_size_m)
                : set.cover_size_m;
    const double rim = body == Body::kPlate ? 0.08 : body == Body::kFrame ? 0.02 : 0.0;
    const Eigen::Vector2d outer = size + Eigen::Vector2d(rim, rim);
    if (body == Body::kFrame || body == Body::kBox) sides(pose, set.height_m, middle, outer, side);
    if (body != Body::kFloating) rectangle(pose, set.height_m, middle, outer, dark);
    marker(set, name, pose, set.height_m);
  }

  cv::Mat image(double gain = 1.0, double noise = 0.0) const {
    Imaging imaging;
    imaging.gain = gain;
    imaging.noise = noise;
    return image(imaging);
  }

  cv::Mat image(const Imaging& how) const {
    cv::Mat light = averaged(how.tone_curve);
    if (how.blur_px > 0)
      cv::GaussianBlur(light, light, {0, 0}, how.blur_px, how.blur_px, cv::BORDER_REPLICATE);
    if (how.tone_curve) {
      cv::pow(light / 255.0, 1.0 / kGamma, light);
      light *= 255.0;
    }
    for (int y = 0; y < light.rows; ++y) {
      for (int x = 0; x < light.cols; ++x) {
        const float share = static_cast<float>(how.gain * (1.0 - how.uneven * x / light.cols) / 255.0);
        for (int c = 0; c < 3; ++c)
          light.at<cv::Vec3f>(y, x)[c] *= share * how.cast[static_cast<std::size_t>(2 - c)];
      }
    }
    if (how.noise > 0) {
      cv::Mat pixel_noise(light.size(), CV_32FC3);
      cv::RNG random(static_cast<std::uint64_t>(how.seed));
      random.fill(pixel_noise, cv::RNG::NORMAL, 0, how.noise);
      light += pixel_noise;
    }
    cv::Mat result;
    light.convertTo(result, CV_8UC3);
    if (how.jpeg_quality == 0) return result;
    std::vector<std::uint8_t> file;  // OpenCV writes half the resolution of the colours (4:2:0)
    cv::imencode(".jpg", result, file, {cv::IMWRITE_JPEG_QUALITY, how.jpeg_quality});
    return cv::imdecode(file, cv::IMREAD_COLOR);
  }

  const lens::Camera camera;

 private:
  static constexpr int kFold = 8;
  static constexpr double kGamma = 2.2;
  struct Shape {
    std::vector<Eigen::Vector2d> outline;  ///< in sample points
    double top, bottom;
    cv::Vec3b bgr;
  };

  static std::vector<Eigen::Vector2d> cornersOf(const Eigen::Vector2d& offset, const Eigen::Vector2d& size) {
    std::vector<Eigen::Vector2d> corners;
    for (const Eigen::Vector2d& u : {Eigen::Vector2d(-1, -1), {1, -1}, {1, 1}, {-1, 1}})
      corners.emplace_back(offset + 0.5 * u.cwiseProduct(size));
    return corners;
  }

  void face(const std::vector<Eigen::Vector3d>& corners, const dataset::Rgb& rgb) {
    constexpr int kSteps = 8;  // along each edge, so that distortion bends it
    Shape shape;
    shape.bgr = {rgb[2], rgb[1], rgb[0]};
    shape.top = 1e9, shape.bottom = -1e9;
    for (std::size_t c = 0; c < corners.size(); ++c) {
      for (int s = 0; s < kSteps; ++s) {
        const Eigen::Vector3d p = corners[c] + (corners[(c + 1) % corners.size()] - corners[c]) * s / kSteps;
        const auto pixel = camera.pixelFromPoint(p);
        if (!pixel) return;
        shape.outline.emplace_back(kFold * (pixel->array() + 0.5) - 0.5);
        shape.top = std::min(shape.top, shape.outline.back().y());
        shape.bottom = std::max(shape.bottom, shape.outline.back().y());
      }
    }
    shapes_.push_back(shape);
  }

  /// Fills the sample points of a row that lie inside the shape.
  static void fill(const Shape& shape, double y, cv::Vec3b* row, int columns,
                   std::vector<double>& crossings) {
    if (y < shape.top || y > shape.bottom) return;
    crossings.clear();
    for (std::size_t i = 0; i < shape.outline.size(); ++i) {
      const Eigen::Vector2d &a = shape.outline[i], &b = shape.outline[(i + 1) % shape.outline.size()];
      if ((a.y() <= y) != (b.y() <= y))
        crossings.push_back(a.x() + (y - a.y()) / (b.y() - a.y()) * (b.x() - a.x()));
    }
    std::sort(crossings.begin(), crossings.end());
    for (std::size_t i = 0; i + 1 < crossings.size(); i += 2) {
      const double begin = std::max(0.0, std::ceil(crossings[i])),
                   end = std::min(columns - 1.0, std::floor(crossings[i + 1]));
      for (int x = static_cast<int>(begin); x <= end; ++x) row[x] = shape.bgr;
    }
  }

  cv::Mat averaged(bool linear_light) const {
    float light[256];
    for (int k = 0; k < 256; ++k)
      light[k] = static_cast<float>(linear_light ? 255.0 * std::pow(k / 255.0, kGamma) : k);
    const int width = camera.model().image_width_px, height = camera.model().image_height_px;
    cv::Mat result(height, width, CV_32FC3), fine(kFold, width * kFold, CV_8UC3);
    std::vector<double> crossings;
    for (int y = 0; y < height; ++y) {
      fine.setTo(cv::Scalar(floor_[2], floor_[1], floor_[0]));
      for (const Shape& shape : shapes_) {
        for (int k = 0; k < kFold; ++k)
          fill(shape, y * kFold + k, fine.ptr<cv::Vec3b>(k), fine.cols, crossings);
      }
      for (int x = 0; x < width; ++x) {
        cv::Vec3f sum(0, 0, 0);
        for (int k = 0; k < kFold; ++k)
          for (int i = 0; i < kFold; ++i)
            for (int c = 0; c < 3; ++c) sum[c] += light[fine.at<cv::Vec3b>(k, x * kFold + i)[c]];
        result.at<cv::Vec3f>(y, x) = sum / static_cast<float>(kFold * kFold);
      }
    }
    return result;
  }

  dataset::Rgb floor_;
  std::vector<Shape> shapes_;
};

inline dataset::MarkerSet patchSet() {
  dataset::MarkerSet set;
  set.height_m = 0.3;
  set.team = {20, 90, 220};
  set.team_offset_m = {-0.06, 0.0};
  set.individual_offset_m = {0.06, 0.0};
  set.patch_size_m = {0.09, 0.12};
  set.robots["r1"].individual = {230, 60, 60};
  set.robots["r2"].individual = {60, 200, 60};
  set.robots["r3"].individual = {200, 60, 200};
  return set;
}

/// Four robots that share colours: three have equal covers, each colour of a head is the colour of another
/// robot's tail, and r4 has a cover in the colour of r1's head.
inline dataset::MarkerSet coverSet() {
  const dataset::Rgb blue{30, 70, 210}, red{215, 40, 40}, green{40, 180, 60}, yellow{225, 205, 30};
  dataset::MarkerSet set;
  set.kind = dataset::MarkerKind::kCoverTailHead;
  set.height_m = 0.12;
  set.cover_size_m = {0.12, 0.10};
  set.tail_offset_m = {-0.035, 0.0};
  set.tail_size_m = {0.03, 0.07};
  set.head_offset_m = {0.03, 0.0};
  set.head_size_m = {0.045, 0.05};
  set.robots["r1"] = {{}, blue, green, red};
  set.robots["r2"] = {{}, blue, red, green};
  set.robots["r3"] = {{}, blue, yellow, red};
  set.robots["r4"] = {{}, red, green, yellow};
  return set;
}

inline lens::CameraModel ceilingCamera() {
  lens::CameraModel model;
  model.kind = lens::CameraKind::kPinhole;
  model.projection = lens::Projection::kPinhole;
  model.image_width_px = 640;
  model.image_height_px = 480;
  model.focal_px = {410.0, 410.0};
  model.principal_point_px = {319.5, 239.5};
  model.position_m = {0.2, -0.1, 3.0};
  return model;
}

/// Tilted by 15°, with barrel distortion.
inline lens::CameraModel tiltedCamera() {
  lens::CameraModel model = ceilingCamera();
  model.position_m = {0.3, -0.2, 2.8};
  model.rotation_rpy_deg = {13.0, -7.5, 20.0};
  model.distortion = {-0.25, 0.06, 0.0005, -0.0005, 0.0};
  return model;
}

}  // namespace omnifleet::markers
