#include "local_mapper/messages.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace omnifleet::local_mapper {
namespace {

const char* reasonOf(FrameState state) {
  switch (state) {
    case FrameState::kOk:
      return "";
    case FrameState::kMissing:
      return "the camera has no image for it; see the log of the camera";
    case FrameState::kUnreadable:
      return "the camera cannot decode its image; see the log of the camera";
    case FrameState::kWrongSize:
      return "the image has another size than sensor.yaml says; use the calibration of this resolution";
    case FrameState::kEmpty:
      return "the image has no pixels; see the log of the camera";
    case FrameState::kNonFinite:
      return "a number is not finite; check the publisher";
    case FrameState::kDark:
      return "the image is dark; check lens cap, light and exposure";
    case FrameState::kOverexposed:
      return "the image is overexposed; shorten the exposure";
    case FrameState::kTorn:
      return "the camera overwrote it while it was read; the host is too slow";
    case FrameState::kOutOfOrder:
      return "it is not later than the frame before; check the camera's clock";
  }
  return "";
}

/// "0.33 m behind, 0.50 m right" of a place in base_link.
std::string placeOf(const Eigen::Vector2d& at_m) {
  return fmt::format("{:.2f} m {}, {:.2f} m {}", std::abs(at_m.x()), at_m.x() < 0 ? "behind" : "ahead",
                     std::abs(at_m.y()), at_m.y() < 0 ? "right" : "left");
}

}  // namespace

Message frameRejected(FrameState state) {
  return {codeOf(state), reasonOf(state)};
}

Message floorHidden(const std::string& camera, double self_mask_radius_px) {
  return {ErrorCode::kFloorHidden,
          fmt::format("camera {}: hardly any floor is visible around the robot; obstacles stand close on all "
                      "sides, or its own body is taken for floor. If the room is open, enlarge "
                      "self_mask_radius_px ({:g}) in its sensor.yaml",
                      camera, self_mask_radius_px)};
}

Message noFloorAhead() {
  return {ErrorCode::kFloorHidden,
          "the image shows no floor; check pitch and height of the camera in its sensor.yaml"};
}

Message obstacleTooNear() {
  return {ErrorCode::kFloorHidden, "an obstacle fills the view; the robot must drive backwards or turn"};
}

Message frameGap(const std::string& camera, double gap_s, std::uint32_t frame) {
  return {ErrorCode::kFrameGap,
          fmt::format("camera {}: no frame for {:.1f} s before frame {}; optical flow restarts there", camera,
                      gap_s, frame)};
}

Message undecidedRegions(const std::string& camera,
                         const std::vector<std::pair<std::uint32_t, Eigen::Vector2d>>& at) {
  constexpr std::size_t kListed = 4;
  std::string places;
  const std::size_t listed = std::min(at.size(), kListed);
  for (std::size_t i = 0; i < listed; ++i) {
    const auto& [frame, at_m] = at[i];
    places += fmt::format("{}frame {}, {}", i > 0 ? "; " : "", frame, placeOf(at_m));
  }
  if (listed < at.size()) places += fmt::format("; and {} more", at.size() - listed);
  return {ErrorCode::kUndecidedRegions,
          fmt::format("camera {}: region nearly of the floor's colour (obstacle, wall, floor pattern or "
                      "shadow): {}. It is not mapped, and the space behind it stays unknown",
                      camera, places)};
}

Message lensMismatch(const std::string& camera, double lit, const lens::CameraModel& model) {
  return {
      ErrorCode::kLensMismatch,
      fmt::format("camera {}: the image continues beyond focal_px ({:g} px) from its centre ({:.0f} % of the "
                  "pixels there), where an orthographic lens shows nothing; distances are wrong. Correct "
                  "projection (probably equidistant) and focal_px in its sensor.yaml",
                  camera, model.focal_px.x(), 100.0 * lit)};
}

Message lensContradicted(const std::string& camera, const LensVerdict& verdict,
                         const lens::CameraModel& model) {
  const ImageCircle& circle = verdict.circle;
  const std::string edge =
      fmt::format("camera {}: the image ends {:.0f} px from its centre", camera, circle.radius_px);
  std::string text;
  switch (verdict.contradiction) {
    case Contradiction::kNone:
      return {};
    case Contradiction::kNoEdge:
      text = fmt::format(
          "camera {}: the image is a circle of {:.0f} px about its centre, as that of a fisheye lens, but "
          "its "
          "sensor.yaml describes a lens whose image has no round edge; distances are wrong. Use the "
          "calibration of the fisheye lens",
          camera, circle.radius_px);
      break;
    case Contradiction::kCentre:
      text = fmt::format(
          "camera {}: the image is a circle about ({:.0f}, {:.0f}) px, but the principal point in its "
          "sensor.yaml is ({:g}, {:g}) px, {:.0f} % of the circle's radius away; distances are wrong. Check "
          "the order of the values (fx, fy, cx, cy) and that the calibration is of this camera and image "
          "size",
          camera, circle.centre_px.x(), circle.centre_px.y(), model.principal_point_px.x(),
          model.principal_point_px.y(), 100.0 * verdict.centre_off_px / circle.radius_px);
      break;
    case Contradiction::kStated:
      text = fmt::format(
          "{}, but by its sensor.yaml the view of {:g}° ends at {:.0f} px; distances are wrong unless "
          "fov_deg "
          "alone is too large. Correct projection, focal_px and fov_deg",
          edge, model.fov_deg, verdict.stated_px);
      break;
    case Contradiction::kTooWide:
      text = fmt::format(
          "{}; by its sensor.yaml that is a view of {:.0f}°, more than any fisheye lens has; distances are "
          "wrong. Use the calibration of this camera and image size (projection, focal_px, distortion). If "
          "the lens has this view, state fov_deg: {:.0f}",
          edge, verdict.view_deg, verdict.view_deg);
      break;
    case Contradiction::kTooNarrow:
      text = fmt::format(
          "{}; by its sensor.yaml that is a view of {:.0f}°, less than a fisheye lens has; distances are "
          "wrong. Use the calibration of this camera and image size (projection, focal_px, distortion). If "
          "the lens has this view, state fov_deg: {:.0f}",
          edge, verdict.view_deg, verdict.view_deg);
      break;
  }
  return {ErrorCode::kLensMismatch, text};
}

std::string imageEnd(const std::string& camera, const LensVerdict& verdict) {
  const ImageCircle& circle = verdict.circle;
  return fmt::format(
      "camera {}: the image ends {:.1f} ± {:.1f} px from ({:.1f}, {:.1f}), {:.1f} px off the principal "
      "point; by "
      "its sensor.yaml that is a view of {:.1f}°. Compare it with the data sheet of the lens{}",
      camera, circle.radius_px, circle.radius_sigma_px, circle.centre_px.x(), circle.centre_px.y(),
      verdict.centre_off_px, verdict.view_deg,
      verdict.states_view ? "" : ", and state the true value as fov_deg");
}

Message lensPartlyOccluded(const std::string& camera, double share, std::uint32_t frame,
                           double unstated_view_deg) {
  std::string text = fmt::format(
      "camera {}: {:.0f} % of the view is occluded from frame {} on; that part is ignored, the "
      "rest is used. Clean the lens or remove what hides it",
      camera, 100.0 * share, frame);
  if (unstated_view_deg > 0.0)
    text += fmt::format(
        ". If it is the dark rim around the image, state fov_deg in its sensor.yaml (by its calibration the "
        "image ends at {:.0f}°)",
        unstated_view_deg);
  return {ErrorCode::kLensOccluded, text};
}

Message floorOnly(const std::string& camera, double driven_m) {
  return {ErrorCode::kFloorOnly,
          fmt::format("camera {}: only floor in the first {:.1f} m driven; the room is empty, or the lens is "
                      "occluded. If the room is not empty, look at the image",
                      camera, driven_m)};
}

Message wheelsUnmatched(const std::string& robot, const TimeRange& frames, const TimeRange& rows) {
  return {ErrorCode::kWheelsUnmatched,
          fmt::format(
              "{}: no wheel sample at the time of a frame; odometry is not used. The first frames are "
              "stamped {}, wheel samples {}. Likely cause: {}. Use one clock for both, times in ns",
              robot, toString(frames), toString(rows), likelyCause("times of wheel samples", rows, frames))};
}

Message wheelsSilent(const std::string& robot, int frames) {
  return {
      ErrorCode::kWheelsUnmatched,
      fmt::format("{}: no wheel sample during the first {} frames; odometry is not used. Check the publisher "
                  "of wheels/odometry and its partition",
                  robot, frames)};
}

}  // namespace omnifleet::local_mapper
