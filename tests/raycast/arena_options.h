#pragma once

namespace omnifleet::raycast {

/// Recording of the experiments of Ahmed et al. 2013 (Figs. 5 and 6).
struct ArenaOptions {
  unsigned seed = 0;  ///< of arena, paths and noise
  int layout = 1;     ///< of the walls of blocks: 1 or 2
  int frames = 250;   ///< per front camera
  double rate_hz = 5.0;

  double ceiling_rate_hz = 0.0;   ///< of the ceiling cameras; 0: rate_hz
  double ceiling_offset_s = 0.0;  ///< the first ceiling image follows the first front image by this time
  double stale_s = 0.0;           ///< a ceiling image shows the robots this time before its time stamp
  double wait_s = 0.0;            ///< stop-and-wait: robots stand this long before each front image
  double exposure_s = 0.0;        ///< motion blur: exposure time of all cameras; the time stamp is its middle

  int cards = 3;              ///< flat cards in colours of the markers on the floor
  double light = 1.0;         ///< brightness; 1: bright
  double noise = 1.5;         ///< σ, grey levels
  double glare = 0.0;         ///< specular share of the floor
  double direct = 0.5;        ///< share of the lamps in the light; the rest has no direction and no shadows
  double ceiling_k1 = -0.24;  ///< radial distortion of the ceiling cameras (OpenCV)
  double ceiling_tilt_deg = 1.5;  ///< of a ceiling camera about each horizontal axis, at most
  bool patches = false;           ///< markers of kind patches; otherwise cover_tail_head
  double focal_error = 0.0;       ///< relative error of the focal length in each sensor.yaml
  double tilt_error_deg = 0.0;    ///< error of the optical axis in each sensor.yaml

  /// Dim light, shadows, glare, noise, a strong distortion and a calibration that is slightly wrong.
  void makeHard() {
    light = 0.42;
    noise = 4.0;
    glare = 0.25;
    direct = 0.75;
    ceiling_k1 = -0.30;
    focal_error = 0.003;
    tilt_error_deg = 0.2;
    cards = 6;
  }
};

}  // namespace omnifleet::raycast
