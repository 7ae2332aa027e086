#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "lens/camera.h"
#include "local_mapper/lens_verdict.h"
#include "observation/error_code.h"
#include "observation/observation.h"
#include "observation/time_range.h"

// What the local mapper reports about a camera. `camera` is its id, `frame` its sequence number.
namespace omnifleet::local_mapper {

/// Why a frame of this state is rejected, and what to do.
Message frameRejected(FrameState state);
/// Hardly any free floor around the robot.
Message floorHidden(const std::string& camera, double self_mask_radius_px);
/// A forward camera shows no floor: it looks at the sky or at an even surface.
Message noFloorAhead();
/// An obstacle fills the view of a forward camera.
Message obstacleTooNear();
/// No frame for `gap_s` seconds before `frame`.
Message frameGap(const std::string& camera, double gap_s, std::uint32_t frame);
/// Regions of nearly the floor's colour. @param at a frame and the place in its base_link, metres, of each
Message undecidedRegions(const std::string& camera,
                         const std::vector<std::pair<std::uint32_t, Eigen::Vector2d>>& at);
/// An orthographic lens shows something beyond r = F. @param lit share of the pixels there
Message lensMismatch(const std::string& camera, double lit, const lens::CameraModel& model);
/// The round edge of the image contradicts the lens. @param verdict with a contradiction
Message lensContradicted(const std::string& camera, const LensVerdict& verdict,
                         const lens::CameraModel& model);
/// A line for the log: where the image ends by its calibration, for comparison with the lens' data sheet.
std::string imageEnd(const std::string& camera, const LensVerdict& verdict);
/// @param share of the view that is occluded
/// @param unstated_view_deg angle at which the image ends if sensor.yaml does not state it, else 0
Message lensPartlyOccluded(const std::string& camera, double share, std::uint32_t frame,
                           double unstated_view_deg);
/// Only floor for the first `driven_m` metres.
Message floorOnly(const std::string& camera, double driven_m);

/// No frame lies in the time range of the wheel rows. @param frames, rows acquisition times
Message wheelsUnmatched(const std::string& robot, const TimeRange& frames, const TimeRange& rows);
/// No wheel row has arrived during `frames` frames.
Message wheelsSilent(const std::string& robot, int frames);

}  // namespace omnifleet::local_mapper
