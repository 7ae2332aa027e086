#pragma once

#include <vector>

#include "geometry/pose2.h"
#include "options/options.h"
#include "scan/line_scan.h"
#include "scan/place_grid.h"
#include "scan/scan_matcher.h"

namespace omnifleet::scan {

struct PlaceSearchOptions {
  double cell_m = 0.05;         ///< m; of the grid and of the steps of translation
  int levels = 5;               ///< of the search tree; its widest node covers 2^(levels − 1) cells
  double max_range_m = 30.0;    ///< m; longer beams are left out
  double min_score = 0.5;       ///< 1; worse places are not searched for
  double margin = 0.2;          ///< 1; nor are places worse than the best one by more than this
  double unknown_weight = 0.4;  ///< 1; weight of a beam that ends in never-seen space
  double free_weight = 0.25;    ///< 1; loss for a beam that ends in space that the references saw as free
  double through_weight = 0.5;  ///< 1; loss for a beam that passes through a surface
  double distinct_m = 0.3;      ///< m; two candidates differ by this or …
  double distinct_rad = 0.15;   ///< rad; … by this
  int beams = 180;              ///< at most so many beams of the scan are used
  int min_beams = 30;           ///< scans with fewer beams give nothing
  int most = 4;                 ///< candidates, at most
  int max_nodes = 1'000'000;    ///< of the search tree; a search that needs more gives nothing
  static PlaceSearchOptions read(const options::Section& section);
  /// With other defaults.
  static PlaceSearchOptions read(const options::Section& section, const PlaceSearchOptions& defaults);
};

struct PlaceCandidate {
  Pose2 map_from_scan;
  double score = 0.0;  ///< 0..1, see PlaceSearch; 1: every beam ends at a surface
  double known = 0.0;  ///< share of the scan's beams that end in space that the references saw
};

/// Global relocalization of a scan among others: correlative scan matching (Olson 2009, "Real-time
/// correlative scan matching") by branch and bound (Hess et al. 2016, "Real-time loop closure in 2D LIDAR
/// SLAM", Algorithm 3 and equations 13–15).
///
/// A beam that ends in known space has the value v of that cell (PlaceGrid) and the weight 1. One that ends
/// in never-seen space has the value 0 and the weight unknown_weight. With the number t of the beams that
/// pass a surface and are behind it, far from every surface, before their end:
///     score = (Σ values − through_weight · t) / Σ weights.
/// The scanner itself must stand in space that some reference saw as free.
///
/// Departures from Hess et al.: (1) Free space and passed surfaces lower the score. (2) Nodes branch in
/// heading too: a node at level k covers 2^k steps in x, y and heading. A step of heading moves the end of a
/// beam of the reference range (90 % of the beams are shorter) by one cell. From the middle heading of a node
/// the ends of beams of up to 1/2, 1, 2 and 3 reference ranges move by at most 1/4, 1/2, 1 and 3/2 of 2^k
/// cells, so windows of 3/2, 2, 3 and 4 times 2^k cells cover them. Longer beams are left out. (3) The bound
/// of a node allows for unknown cells: a beam whose window is all known adds its largest value and the weight
/// 1, another one its largest value m ≥ 0 and the weight max(m, unknown_weight). This is an upper bound
/// because a score s ≤ 1 is reached only if Σ (values − s · weights) ≥ 0, and neither choice lowers a term of
/// this sum. (4) Best first instead of depth first: leaves leave the queue in the order of their exact
/// scores, so the candidates are those of greedy non-maximum suppression over all leaves. (5) A leaf that
/// climbs to an accepted candidate by steps of up to two cells and headings is on the flank of that one, and
/// no candidate.
///
/// Equal input gives equal bits. Refine the candidates by ScanMatcher: a leaf is half a cell off.
class PlaceSearch {
 public:
  explicit PlaceSearch(const PlaceSearchOptions& options = {}) : options_(options) {}

  /// Builds the grids. The scans are read here and not kept.
  void setReferences(const std::vector<Reference>& references);
  bool empty() const { return grid_.empty(); }

  /// Best distinct places, the best first. Places outside the extent of the references are not searched.
  /// @param start map_from_scan at the centre of the search
  std::vector<PlaceCandidate> search(const LineScan& scan, const Pose2& start, double reach_m,
                                     double reach_rad) const;

  /// The scan's score at a pose, as the search would give it. 0 if too few beams are usable, or if no
  /// reference saw the place of the scanner as free.
  PlaceCandidate evaluate(const LineScan& scan, const Pose2& map_from_scan) const;
  /// Spacing of the headings in a search, radians. 0 if too few beams are usable.
  double headingStep(const LineScan& scan) const;

 private:
  bool isValid(const Pose2& pose) const;

  PlaceSearchOptions options_;
  PlaceGrid grid_;
};

}  // namespace omnifleet::scan
