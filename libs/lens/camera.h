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

/// What `sensor.yaml` says. Pixel centres are integers: the top-left one is (0, 0).
struct CameraModel {
  CameraKind kind = CameraKind::kFisheye;
  Projection projection = Projection::kEquidistant;
  int image_width_px = 0;
  int image_height_px = 0;
  Eigen::Vector2d focal_px{0.0, 0.0};
  Eigen::Vector2d principal_point_px{0.0, 0.0};
  double fov_deg = 180.0;  ///< full angle of the valid circle; ignored for pinhole and equirectangular
  /// kannala_brandt: k1, k2, k3, k4 (OpenCV's fisheye). pinhole: k1, k2, p1, p2, k3 (OpenCV; 8 values add k4,
  /// k5, k6). ocam (Scaramuzza et al., OCamCalib; catadioptric cameras too): [ss0, ss1, ss2, ss3, ss4, c, d,
  /// e], where the last three are always c, d, e and the polynomial may be shorter or longer. With row,
  /// column relative to the centre [row; column] = [c d; e 1]·[x'; y'], ray (x', y', ss0 + ss1 ρ + …), ss0 <
  /// 0, x' down, y' right, z backward. The centre is principal_point_px = [column, row], 0-based: OCamCalib's
  /// MATLAB xc (row), yc (column) are 1-based, so principal_point_px = [yc − 1, xc − 1]; its C files' are
  /// 0-based and taken as they are.
  std::vector<double> distortion;
  Eigen::Vector3d position_m{0.0, 0.0, 0.0};  ///< in base_link (ceiling: in map)
  Eigen::Vector3d rotation_rpy_deg{0.0, 0.0, 0.0};
  double self_mask_radius_px = 0.0;
  /// Of the calibration that gave these numbers, over all its corners; 0 where unknown. Informs, nothing uses
  /// it.
  double reprojection_rms_px = 0.0;

  /// Optical axes (x right, y down, z forward) in the parent frame: Rz(y)·Ry(p)·Rx(r)·R0; R0 looks straight
  /// down, image right u → −y, image down v → −x.
  Eigen::Isometry3d parentFromCamera() const;

  /// Reads `sensor.yaml` (also OpenCV and Kalibr calibration files as they are). Throws options::Error naming
  /// file, line, key and bound.
  static CameraModel load(const std::string& path);
  static CameraModel read(const options::Section& section);
  /// The same as text of sensor.yaml; reading it back gives equal numbers.
  std::string toYaml() const;
};

/// Ray ↔ pixel of one lens, exact inverses of each other over the whole field of view, beyond 90° too.
/// Rays are bearing vectors (any positive length) in the optical frame; angles ≥ 90° have z ≤ 0.
class Lens {
 public:
  virtual ~Lens() = default;
  /// Pixel of a ray; nothing where the lens does not see it (outside the field of view, or no image, e.g. r ≥
  /// F of the orthographic lens, Choi eq. 7, whatever its fov_deg says). The pixel may lie outside the image.
  virtual std::optional<Eigen::Vector2d> pixelFromRay(const Eigen::Vector3d& ray) const = 0;
  /// Unit ray of a pixel; nothing outside the valid circle. Never NaN.
  virtual std::optional<Eigen::Vector3d> rayFromPixel(const Eigen::Vector2d& pixel) const = 0;

  /// Throws options::Error (naming the angle where it breaks) when the projection cannot be inverted over the
  /// field of view; only an orthographic one is cut at 90° instead, where it has no image (Choi eq. 7).
  static std::unique_ptr<const Lens> make(const CameraModel& model);
};

/// A lens at its place. "parent" is base_link for a robot's camera and map for a ceiling camera; the floor is
/// z = 0.
class Camera {
 public:
  explicit Camera(const CameraModel& model);

  const CameraModel& model() const { return model_; }
  const Lens& lens() const { return *lens_; }
  const Eigen::Isometry3d& parentFromCamera() const { return parent_from_camera_; }
  double height() const { return model_.position_m.z(); }               ///< metres over the floor
  Eigen::Vector2d foot() const { return model_.position_m.head<2>(); }  ///< in the parent frame

  /// Point of the plane z = height_m (parent frame) seen at a pixel; nothing at or above the horizon.
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
