#include "distance_vector/options.h"

namespace omnifleet::distance_vector {

WalkOptions WalkOptions::read(const options::Section& section) {
  WalkOptions o;
  section.read("seed_rows", o.seed_rows, {0.02, 0.5});
  section.read("min_chroma", o.min_chroma, {1.0, 255.0});
  section.read("min_contrast", o.min_contrast, {1.0, 255.0});
  section.read("contrast_share", o.contrast_share, {0.0, 1.0});
  section.read("sigmas", o.sigmas, {1.0, 20.0});
  section.read("falloff_per_m", o.falloff_per_m, {0.0, 10.0});
  section.read("shadow_ratio", o.shadow_ratio, {0.0, 1.0});
  section.read("light_ratio", o.light_ratio, {1.0, 10.0});
  section.read("flat_m", o.flat_m, {0.0, 1.0});
  section.read("largest_flat_m", o.largest_flat_m, {0.0, 100.0});
  section.read("min_run_px", o.min_run_px, {1, 20});
  section.read("horizon_px", o.horizon_px, {1.0, 200.0});
  section.read("check_px", o.check_px, {2.0, 200.0});
  section.read("new_floor_frames", o.new_floor_frames, {1, 1000});
  section.finish();
  return o;
}

EdgeOptions EdgeOptions::read(const options::Section& section) {
  EdgeOptions o;
  section.read("min_contrast", o.min_contrast, {1.0, 255.0});
  section.read("min_hue_contrast", o.min_hue_contrast, {0.0, 255.0});
  section.read("min_sigmas", o.min_sigmas, {1.0, 50.0});
  section.read("falloff_per_m", o.falloff_per_m, {0.001, 100.0});
  section.read("max_shift_px", o.max_shift_px, {1.0, 8.0});
  section.read("sigma_px", o.sigma_px, {0.001, 5.0});
  section.read("hue_sigma_px", o.hue_sigma_px, {0.001, 5.0});
  section.read("shading_per_px", o.shading_per_px, {0.0001, 1.0});
  section.read("hue_shared_px", o.hue_shared_px, {0.0, 5.0});
  section.read("weak_shared_px", o.weak_shared_px, {0.0, 5.0});
  section.read("window_px", o.window_px, {0, 100});
  section.finish();
  return o;
}

LiteralOptions LiteralOptions::read(const options::Section& section) {
  LiteralOptions o;
  section.read("scale_file", o.scale_file);
  section.read("metres_per_ceiling_px", o.metres_per_ceiling_px, options::kPositive);
  section.read("field_of_view_deg", o.field_of_view_deg, {1.0, 179.0});
  section.finish();
  return o;
}

Options Options::read(const options::Section& section) {
  Options o;
  std::string method = "projected";
  section.read("method", method, {"projected", "literal"});
  o.method = method == "literal" ? Method::kLiteral : Method::kProjected;
  section.read("bearings", o.bearings, {90, 7200});
  section.read("max_range_m", o.max_range_m, options::kPositive);
  section.read("jump_px", o.jump_px, {0.5, 50.0});
  section.read("jump_columns", o.jump_columns, {0, 20});
  section.read("silhouette_sigmas", o.silhouette_sigmas, {0.5, 100.0});
  section.read("shared_px", o.shared_px, {0.0, 5.0});
  section.read("min_floor_end", o.min_floor_end, {1, 10000});
  section.read("outlier_sigmas", o.outlier_sigmas, {2.0, 100.0});
  o.walk = WalkOptions::read(section.child("walk"));
  o.edge = EdgeOptions::read(section.child("edge"));
  o.literal = LiteralOptions::read(section.child("literal"));
  if (o.method == Method::kLiteral && !(o.literal.metres_per_ceiling_px > 0.0))
    section.fail("literal", "the literal method needs metres_per_ceiling_px");
  section.finish();
  return o;
}

}  // namespace omnifleet::distance_vector
