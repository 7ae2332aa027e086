#pragma once

// Choi et al. 2014, §III: one fisheye image in, one local map out. Pure: no DDS, no clock, no thread.

#include <memory>

#include "flow/feature_flow.h"
#include "ground/blob_splitter.h"
#include "ground/contour.h"
#include "ground/floor_boundary.h"
#include "ground/ground_segmenter.h"
#include "ground/notch_splitter.h"
#include "ground/region_connection.h"
#include "ground/skirting.h"
#include "ground/wall_finder.h"
#include "lens/camera.h"
#include "lens/correction.h"
#include "local_mapper/camera_faults.h"
#include "local_mapper/floor_odometry.h"
#include "local_mapper/floor_scan.h"
#include "local_mapper/frame_check.h"
#include "local_mapper/lens_occlusion.h"
#include "local_mapper/silhouette.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::local_mapper {

struct Options {
  FrameCheckOptions check;               ///< `frame`: limits of dark, overexposed and missing frames
  FaultOptions faults;                   ///< `faults`: frozen or fully occluded camera
  LensOcclusionOptions lens_occlusion;   ///< `lens_occlusion`: partly occluded view
  ground::ViewOptions view;              ///< `view`: which pixels can show floor
  lens::CorrectionOptions lens;          ///< `lens`: §III.4, lens model that projects points to the floor
  ground::SegmenterOptions ground;       ///< `ground`: §III.2, ground removal
  ground::WallOptions walls;             ///< `walls`: walls of a room, and what stands in front of them
  ground::ConnectionOptions connection;  ///< `connection`: Algorithm 1
  ground::ContourOptions contour;        ///< `contour`: sub-pixel outline
  ground::SplitOptions split;            ///< `split`: objects in front of one another, by colour
  ground::NotchOptions notches;          ///< `notches`: objects of one colour, by outline
  SilhouetteOptions silhouette;          ///< `silhouette`: outline, support function, which blobs are objects
  ScanOptions scan;                      ///< `scan`
  ground::BoundaryOptions boundary;      ///< `boundary`: where the floor ends, for localization
  ground::SkirtingOptions skirting;      ///< `skirting`: boards along walls that look like floor
  FloorOdometryOptions floor_motion;     ///< `floor_motion`: motion by the texture of the floor
  flow::FeatureFlowOptions flow;         ///< `flow`: §III.3 and the filter of §III.5
  static Options read(const options::Section& section);
};

/// The stage. Calls must come in the order of acquisition, because it keeps the previous frame for the
/// optical flow.
class LocalMapper {
 public:
  /// Throws options::Error when the camera shows no floor or the seed region is empty.
  LocalMapper(const lens::Camera& camera, const Options& options);
  ~LocalMapper();
  LocalMapper(LocalMapper&&) noexcept;
  LocalMapper& operator=(LocalMapper&&) noexcept;

  /// Returns one local map per frame, invalid frames included (`state` gives the reason; no objects, no
  /// scan).
  /// @param frame image BGR8 or grey, only read during the call
  /// @param wheels motion base_link(previous) ← base_link(this frame) by odometry; `valid` false without
  /// odometry
  /// @return the local map (robot name left empty), valid until the next call
  const LocalMap& process(const Frame& frame, const Motion& wheels);

  /// For debug images: the regions of the last valid frame, before and after Algorithm 1.
  const std::vector<ground::Blob>& labelledBlobs() const;
  const std::vector<ground::Blob>& connectedBlobs() const;
  /// Outline on the floor of each object of the last local map, in the same order.
  const std::vector<FloorContour>& floorContours() const;
  const lens::Camera& camera() const;
  /// Points of the last frame (of outlines and vectors) for which the correcting lens has no floor point
  /// (Choi eq. 7: r ≥ F). They are left out.
  std::size_t rejectedPoints() const;
  /// Where regions of the last frame begin that may be objects of the floor's colour, part of its pattern or
  /// a shadow, within the reach of objects. They are not among `objects`; the scan ends at them. base_link,
  /// metres. Consumers need them to know where objects may be missing.
  const std::vector<Eigen::Vector2d>& undecided() const;
  /// Free share of the visible floor's depth in the last valid frame, the median over all bearings.
  double freeShare() const;
  /// Occluded share of the view. It is left out like pixels beyond the edge of the view.
  double occludedShare() const;
  /// See FrameCheck::litBeyondLens().
  double litBeyondLens() const;
  /// See OcclusionCheck::bare_m().
  double bare_m() const;
  /// See FrameCheck::gap_s().
  double gap_s() const;
  /// Why the last frame was rejected, if its state does not say so; else kNone.
  const FrameFault& fault() const;

 private:
  void watch(const Frame& frame, const Motion& wheels);
  void restart();

  struct Stages;
  struct Watch;
  std::unique_ptr<Stages> stages_;
  std::unique_ptr<Watch> watch_;
  bool is_blind_ = false;  ///< no usable seed is left for learning the floor
};

}  // namespace omnifleet::local_mapper
