#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "dataset/markers.h"
#include "markers/patch_finder.h"
#include "markers/sub_pixel.h"

namespace omnifleet::markers {

/// A team patch combined with an individual patch.
struct Pair {
  std::size_t team = 0, individual = 0;  ///< indices of the patches
  Detection detection;
};

/// Geometry of a marker set of kind `patches`: tests pairs and computes their pose.
class PatchPairs {
 public:
  PatchPairs(const dataset::MarkerSet& markers, const FinderOptions& options);

  /// Colours in the order of their classes: first the team, then the robots by name.
  const std::vector<dataset::Rgb>& colours() const { return colours_; }
  /// Area of a patch, m².
  double area() const { return size_m_.x() * size_m_.y(); }

  /// All plausible pairs, best first.
  void find(const std::vector<Patch>& patches, std::vector<Pair>& pairs) const;

 private:
  std::optional<Pair> pair(const std::vector<Patch>& patches, std::size_t team, std::size_t individual) const;
  bool plausibleArea(const Patch& patch) const;

  FinderOptions options_;
  std::vector<dataset::Rgb> colours_;
  std::vector<std::string> robots_;
  Eigen::Vector2d team_m_, individual_m_, size_m_;
};

}  // namespace omnifleet::markers
