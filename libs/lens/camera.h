#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "options/options.h"

namespace omnifleet::lens {

enum class CameraKind { kFisheye, kPinhole, kEquirectangular, kCatadioptric };
enum class Projection {
  kOrthographic,
  kEquidistant,
  kEquisolid,
  kStereographic,
  kKannalaBrandt,
  kOcam,
  kPinhole
};

/// Content of a `sensor.yaml`. Pixel centres have integer coordinates; the top-left pixel is (0, 0).
struct CameraModel {
  CameraKind kind = CameraKind::kFisheye;
  Projection projection = Projection::kEquidistant;
  int image_width_px = 0;
  int image_height_px = 0;
  Eigen::Vector2d focal_px{0.0, 0.0};
  Eigen::Vector2d principal_point_px{0.0, 0.0};
  double skew_px = 0.0;    ///< K[0][1]: u = fx·x + skew·y + cx. Fisheye and pinhole; ocam has c, d, e
  double fov_deg = 180.0;  ///< full angle of the valid circle; ignored for pinhole and equirectangular
  /// Distortion values per projection:
  /// kannala_brandt: k1, k2, k3, k4 (OpenCV's fisheye model).
  /// pinhole: k1, k2, p1, p2, k3 (OpenCV; 8 values add k4, k5, k6).
  /// ocam (Scaramuzza et al., OCamCalib; also for catadioptric cameras): [ss0, ss1, ss2, ss3, ss4, c, d, e].
  /// The last three values are always c, d, e; the polynomial may have fewer or more terms. With row and
  /// column relative to the centre: [row; column] = [c d; e 1]·[x'; y'], ray (x', y', ss0 + ss1 ρ + …), ss0 <
  /// 0, x' down, y' right, z backward. The centre is principal_point_px = [column, row], 0-based. OCamCalib's
  /// MATLAB values xc (row) and yc (column) are 1-based, so principal_point_px = [yc − 1, xc − 1]. Its C
  /// files are 0-based, so their values apply unchanged.
  std::vector<double> distortion;
  Eigen::Vector3d position_m{0.0, 0.0, 0.0};  ///< in base_link (ceiling camera: in map)
  Eigen::Vector3d rotation_rpy_deg{0.0, 0.0, 0.0};
  double self_mask_radius_px = 0.0;
  /// Reprojection error of the calibration that produced these numbers, over all corners. 0: unknown. For
  /// information only.
  double reprojection_rms_px = 0.0;

  /// Pose of the optical axes (x right, y down, z forward) in the parent frame: Rz(y)·Ry(p)·Rx(r)·R0. R0
  /// points straight down, with image right (u) along −y and image down (v) along −x.
  Eigen::Isometry3d parentFromCamera() const;

  /// Reads `sensor.yaml`, which may name a calibration file of another program (`calibration:`, `camera:`) or
  /// be one itself (lens/foreign.h lists the formats). Throws options::Error that names file, line, key and
  /// bound: also for a lens model that neither the file nor the user states, and for a lens that makes no
  /// sense for its image.
  static CameraModel load(const std::string& path);
  static CameraModel read(const options::Section& section);
  /// Text of sensor.yaml. Reading it returns equal numbers.
  std::string toYaml() const;
};

/// Ray ↔ pixel of one lens. The two functions are exact inverses over the whole field of view, also beyond
/// 90°. Rays are bearing vectors of any positive length in the optical frame; angles ≥ 90° have z ≤ 0.
class Lens {
 public:
  virtual ~Lens() = default;
  /// Pixel of a ray. Empty outside the field of view, or where the projection has no image: e.g. r ≥ F of the
  /// orthographic lens (Choi eq. 7), independent of its fov_deg. The pixel may lie outside the image.
  virtual std::optional<Eigen::Vector2d> pixelFromRay(const Eigen::Vector3d& ray) const = 0;
  /// Unit ray of a pixel. Empty outside the valid circle. Never NaN.
  virtual std::optional<Eigen::Vector3d> rayFromPixel(const Eigen::Vector2d& pixel) const = 0;

  /// Throws options::Error when the projection cannot be inverted over the field of view; the message names
  /// the limit angle. An orthographic lens does not throw: it ends at 90°, where it has no image (Choi eq.
  /// 7).
  static std::unique_ptr<const Lens> make(const CameraModel& model);
};

/// A lens with its pose. The parent frame is base_link for the camera of a robot and map for a ceiling
/// camera. The floor is z = 0.
class Camera {
 public:
  explicit Camera(const CameraModel& model);

  const CameraModel& model() const { return model_; }
  const Lens& lens() const { return *lens_; }
  const Eigen::Isometry3d& parentFromCamera() const { return parent_from_camera_; }
  double height() const { return model_.position_m.z(); }               ///< metres over the floor
  Eigen::Vector2d foot() const { return model_.position_m.head<2>(); }  ///< in the parent frame

  /// Point of the plane z = height_m (parent frame) that is seen at a pixel. Empty at or above the horizon.
  std::optional<Eigen::Vector2d> planeFromPixel(const Eigen::Vector2d& pixel, double plane_height_m) const;
  std::optional<Eigen::Vector2d> floorFromPixel(const Eigen::Vector2d& pixel) const {
    return planeFromPixel(pixel, 0.0);
  }
  /// Unit ray in the parent frame.
  std::optional<Eigen::Vector3d> rayFromPixel(const Eigen::Vector2d& pixel) const;
  std::optional<Eigen::Vector2d> pixelFromPoint(const Eigen::Vector3d& point_in_parent) const;

 private:
  CameraModel model_;
  std::shared_ptr<const Lens> lens_;
  Eigen::Isometry3d parent_from_camera_;
};

}  // namespace omnifleet::lens
