#include "estimation/estimator.h"

namespace omnifleet::estimation {

DetectorOptions DetectorOptions::read(const options::Section& section) {
  DetectorOptions o;
  section.read("bearing_bias_sigma_rad", o.bearing_bias_sigma_rad, {1e-6, 1.0});
  section.read("focal_sigma", o.focal_sigma, {1e-6, 0.5});
  section.read("range_scale_sigma", o.range_scale_sigma, {1e-6, 0.5});
  section.read("obliqueness_sigma", o.obliqueness_sigma, {1e-6, 2.0});
  section.read("axis_sigma_rad", o.axis_sigma_rad, {1e-6, 1.0});
  section.read("lag_sigma_s", o.lag_sigma_s, {1e-6, 1.0});
  section.read("place_sigma_m", o.place_sigma_m, {1e-6, 1.0});
  section.finish();
  return o;
}

EstimatorOptions EstimatorOptions::read(const options::Section& section) {
  using options::kPositive;
  EstimatorOptions o;
  section.read("initial_sigma_m", o.initial_sigma_m, kPositive);
  section.read("initial_sigma_rad", o.initial_sigma_rad, kPositive);
  section.read("wheel_bias_sigma", o.wheel_bias_sigma, {1e-6, 0.5});
  section.read("body_sigma", o.body_sigma, {1e-9, 0.5});
  section.read("window_frames", o.window_frames, {2, 500});
  section.read("solver_iterations", o.solver_iterations, {1, 100});
  section.read("keyframe_distance_m", o.keyframe_distance_m, options::kNotNegative);
  section.read("keyframe_angle_rad", o.keyframe_angle_rad, options::kNotNegative);
  section.read("keyframe_time_s", o.keyframe_time_s, kPositive);
  section.read("use_landmarks", o.use_landmarks);
  section.read("use_sightings", o.use_sightings);
  section.read("view_sigma_factor", o.view_sigma_factor, kPositive);
  section.read("view_directions", o.view_directions, {8, 360});
  section.read("associate_gate_m", o.associate_gate_m, kPositive);
  section.read("new_landmark_m", o.new_landmark_m, kPositive);
  section.read("new_landmark_contact_m", o.new_landmark_contact_m, kPositive);
  section.read("new_landmark_robot_m", o.new_landmark_robot_m, options::kNotNegative);
  section.read("sighting_gate_m", o.sighting_gate_m, kPositive);
  section.read("sighting_rms_m", o.sighting_rms_m, kPositive);
  section.read("carried_per_s", o.carried_per_s, options::kNotNegative);
  section.read("carried_m", o.carried_m, options::kNotNegative);
  section.read("carried_rad", o.carried_rad, options::kNotNegative);
  section.read("prior_height_m", o.prior_height_m, kPositive);
  section.read("prior_height_sigma_m", o.prior_height_sigma_m, kPositive);
  section.read("moving_mps", o.moving_mps, kPositive);
  section.read("max_landmarks", o.max_landmarks, {1, 10000});
  section.read("publish_views", o.publish_views, {1, 10000});
  section.read("gate_chi2", o.gate_chi2, kPositive);
  section.read("no_wheels_sigma_mps", o.no_wheels_sigma_mps, kPositive);
  section.read("no_wheels_sigma_radps", o.no_wheels_sigma_radps, kPositive);
  o.wheel_log = WheelLogOptions::read(section.child("wheel_log"));
  o.detector = DetectorOptions::read(section.child("detector"));
  o.camera = CameraOptions::read(section.child("camera"));
  o.keyframes = KeyframeOptions::read(section.child("keyframes"));
  o.match = scan::MatchOptions::read(section.child("match"));
  o.appearance = AppearanceOptions::read(section.child("appearance"));
  o.relocalizer = RelocalizerOptions::read(section.child("relocalizer"));
  o.places = PlaceRecognitionOptions::read(section.child("places"));
  o.loops = LoopCheckOptions::read(section.child("loops"));
  o.alignment = MapAlignmentOptions::read(section.child("alignment"));
  o.scan = ScanSourceOptions::read(section.child("scan"));
  o.odometry = OdometryQualityOptions::read(section.child("odometry"));
  o.floor = FloorSourceOptions::read(section.child("floor"));
  section.finish();
  return o;
}

}  // namespace omnifleet::estimation
