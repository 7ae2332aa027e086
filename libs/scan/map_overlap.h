#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "options/options.h"
#include "scan/scan_matcher.h"

namespace omnifleet::scan {

struct OverlapOptions {
  double cell_m = 0.1;  ///< m; surfaces are counted by cells of this size, so that repeated views count once
  double agree_m = 0.06;      ///< m, distance of two views of one surface along a beam, plus `sigmas` σ
  double through_m = 0.15;    ///< m, by which a beam must pass a surface, plus `sigmas` σ, to deny it
  double sigmas = 3.0;        ///< 1, of both ranges
  double most_sigma_m = 0.1;  ///< m; beams whose range is less certain say nothing
  int beams = 120;            ///< at most so many beams of each scan are compared
  double line_m = 1.0;  ///< m; of surfaces in one line, such as a wall, at most so much counts as distinct
  int neighbours = 2;   ///< beams on both sides: all of them must pass a surface to deny it
  static OverlapOptions read(const options::Section& section);
};

/// What two sets of scans say about each other, as lengths of surfaces.
struct Overlap {
  double agree_m = 0.0;       ///< of surfaces that one set shows and the other one confirms
  double contradict_m = 0.0;  ///< of surfaces that one set shows where the other one sees through
  /// The same with surfaces in one line counted up to `line_m`. Rooms have walls in common, furniture
  /// distinguishes them apart: a wall of 5 m says little more than one of 1 m.
  double distinct_agree_m = 0.0, distinct_contradict_m = 0.0;
  /// Mean of n·nᵀ over the confirmed surfaces, n their normals in map. Its smallest eigenvalue is 0 where all
  /// are parallel, 0.5 where they face all directions alike.
  Eigen::Matrix2d normals = Eigen::Matrix2d::Zero();

  /// Share of the distinct surfaces that contradict; 0 without any.
  double contradiction() const {
    const double all_m = distinct_agree_m + distinct_contradict_m;
    return all_m > 0 ? distinct_contradict_m / all_m : 0.0;
  }
};

/// A scan of a set to be compared.
struct View {
  Reference reference;
  /// Per beam, not 0: the surface was there for a short time only and is left out (Transients); null: none.
  const std::vector<std::uint8_t>* transient = nullptr;
};

/// Compares each surface of one set with every scan of the other set that looks towards it. A beam of the
/// other set that ends there confirms it, one that passes denies it, one that ends before it says nothing.
/// Surfaces are the beams with a line. A cell counts as what most beams say. Both directions are added, so
/// that neither an empty map nor one that is full agrees with everything. Sets in a static world contradict
/// each other only where a surface is missed; other rooms with equal walls contradict wherever their
/// furniture differs. (This project.)
Overlap overlapOf(const std::vector<View>& a, const std::vector<View>& b, const OverlapOptions& options);
Overlap overlapOf(const std::vector<Reference>& a, const std::vector<Reference>& b,
                  const OverlapOptions& options);

}  // namespace omnifleet::scan
