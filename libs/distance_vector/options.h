#pragma once

#include <string>

#include "options/options.h"

namespace omnifleet::distance_vector {

enum class Method {
  kProjected,  ///< each boundary pixel is projected to the floor by the calibration
  kLiteral  ///< Ahmed et al. 2013, eq. 1–5: pixels times α(d_r); the image column is taken as the bearing
};

/// Which pixels are floor.
struct WalkOptions {
  double seed_rows = 0.125;      ///< share of the image height: the strip at the bottom that shows the floor
  double min_chroma = 7.0;       ///< grey levels: least deviation across the floor's colour that is no floor
  double min_contrast = 8.0;     ///< grey levels between floor and object
  double contrast_share = 0.07;  ///< of the floor's brightness: likewise. Texture of usual floors is below.
  double sigmas = 5.0;           ///< both limits are at least this many σ of the floor's own variation
  double falloff_per_m = 0.3;    ///< 1/m: share of the brightness that light may fall off per metre of floor
  double shadow_ratio = 0.4;     ///< brightness of a shadow ÷ brightness of the floor beside it, at least
  double light_ratio = 1.25;     ///< what is brighter than this ratio and of the floor's hue is an object
  /// Metres. What is at most this high is floor: robots drive over it. The floor that is seen behind a band
  /// bounds the height of what stands there: lines, seams and flat cards.
  double flat_m = 0.01;
  /// Metres along the line of sight: a flat object on the floor is not larger (the long side of A4). What
  /// hides more of the floor stands, or is a carpet.
  double largest_flat_m = 0.3;
  int min_run_px = 3;        ///< pixels in a row that are no floor
  double horizon_px = 4.0;   ///< pixels below the horizon: the farthest floor that is measured
  double check_px = 8.0;     ///< pixels above the horizon up to which floor-like pixels are followed
  int new_floor_frames = 5;  ///< frames of another colour until it counts as a new floor
  static WalkOptions read(const options::Section& section);
};

/// Where the floor ends in a column.
struct EdgeOptions {
  double min_contrast = 8.0;      ///< grey levels between floor and object
  double min_hue_contrast = 5.0;  ///< grey levels between floor and object, across the floor's colour
  double min_sigmas = 4.0;        ///< least contrast in σ of the pixel noise
  double falloff_per_m = 0.5;     ///< 1/m: σ of the change of the floor's brightness, as a share of it
  double max_shift_px = 6.0;      ///< pixels between the first pixel that is no floor and the edge
  double sigma_px = 0.04;         ///< pixels: σ of an edge of perfect contrast, in luma
  double hue_sigma_px = 0.1;      ///< pixels: likewise in hue, which JPEG subsamples
  double shading_per_px = 0.05;   ///< 1/px: σ of the change of a face's brightness at its foot, its share
  double hue_shared_px =
      0.15;  ///< pixels: σ of edges in hue that neighbouring columns share (coding, shading)
  /// pixels: σ that weak edges share, from the texture of floor and face
  double weak_shared_px = 0.4;
  int window_px = 12;  ///< columns to either side over which the offset of luma and hue is averaged
  static EdgeOptions read(const options::Section& section);
};

struct LiteralOptions {
  std::string scale_file;              ///< file that fit_scale has written; empty: the paper's polynomial
  double metres_per_ceiling_px = 0.0;  ///< m; 0: not given (required for the literal method)
  double field_of_view_deg = 90.0;     ///< degrees: the columns span it evenly (§2.3)
  static LiteralOptions read(const options::Section& section);
};

struct Options {
  Method method = Method::kProjected;
  int bearings = 720;              ///< over the full turn
  double max_range_m = 20.0;       ///< metres from the camera's foot; floor beyond is not measured
  double jump_px = 2.0;            ///< pixels: larger steps between columns are silhouettes
  int jump_columns = 3;            ///< columns at most that a silhouette may mix (pixel, JPEG blocks)
  double silhouette_sigmas = 2.0;  ///< a column at a silhouette that deviates more from its piece is mixed
  double shared_px = 0.15;         ///< pixels: σ that neighbouring columns share (texture, blocks of JPEG)
  int min_floor_end = 8;           ///< columns side by side; fewer without an edge are undecided
  double outlier_sigmas = 5.0;     ///< a column that deviates more from both neighbouring sides has no edge
  WalkOptions walk;
  EdgeOptions edge;
  LiteralOptions literal;
  /// Keys: method (projected, literal), bearings, max_range_m, jump_px, jump_columns, silhouette_sigmas,
  /// shared_px, min_floor_end, outlier_sigmas and the sections walk, edge, literal.
  static Options read(const options::Section& section);
};

}  // namespace omnifleet::distance_vector
