#pragma once

// Choi et al. 2014, §III: one fisheye image in, one local map out. Pure: no DDS, no clock, no thread.

#include <memory>

#include "flow/feature_flow.h"
#include "ground/blob_splitter.h"
#include "ground/contour.h"
#include "ground/ground_segmenter.h"
#include "ground/notch_splitter.h"
#include "ground/region_connection.h"
#include "ground/wall_finder.h"
#include "lens/camera.h"
#include "lens/correction.h"
#include "local_mapper/camera_faults.h"
#include "local_mapper/floor_scan.h"
#include "local_mapper/frame_check.h"
#include "local_mapper/silhouette.h"
#include "local_mapper/view_cover.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::local_mapper {

struct Options {
  FrameCheckOptions check;               ///< `frame`: what counts as black, overexposed, a gap
  FaultOptions faults;                   ///< `faults`: a frozen or a covered camera
  ViewCoverOptions cover;                ///< `cover`: a part of the view that is covered
  ground::ViewOptions view;              ///< `view`: which pixels can show floor
  lens::CorrectionOptions lens;          ///< `lens`: §III.4, which lens carries points to the floor
  ground::SegmenterOptions ground;       ///< `ground`: §III.2, ground removal
  ground::WallOptions walls;             ///< `walls`: a room's walls, and what stands before them
  ground::ConnectionOptions connection;  ///< `connection`: Algorithm 1
  ground::ContourOptions contour;        ///< `contour`: sub-pixel outline
  ground::SplitOptions split;            ///< `split`: things one before the other, by their colours
  ground::NotchOptions notches;          ///< `notches`: things of one colour, by their outline
  SilhouetteOptions silhouette;          ///< `silhouette`: outline, supports, which blobs are objects
  ScanOptions scan;                      ///< `scan`
  flow::FeatureFlowOptions flow;         ///< `flow`: §III.3 and the filter of §III.5
  static Options read(const options::Section& section);
};

/// The stage. Calls must come in the order of acquisition; it keeps the previous frame for the optical flow.
class LocalMapper {
 public:
  /// Throws options::Error when the camera shows no floor or the seed region is empty.
  LocalMapper(const lens::Camera& camera, const Options& options);
  ~LocalMapper();
  LocalMapper(LocalMapper&&) noexcept;
  LocalMapper& operator=(LocalMapper&&) noexcept;

  /// One sample for each frame, invalid ones too (`state` says why, no objects, no scan).
  /// @param frame image BGR8 or grey, only read during the call
  /// @param wheels motion base_link(previous) ← base_link(this frame) by odometry; `valid` false where there
  /// is none
  /// @return the local map (robot name left empty), valid until the next call
  const LocalMap& process(const Frame& frame, const Motion& wheels);

  /// What the debug pictures show: the regions of the last valid frame, before and after Algorithm 1.
  const std::vector<ground::Blob>& labelledBlobs() const;
  const std::vector<ground::Blob>& connectedBlobs() const;
  /// The outline on the floor of each object of the last local map, in its order.
  const std::vector<FloorContour>& floorContours() const;
  const lens::Camera& camera() const;
  /// Points of the last frame (of outlines and vectors) that the correcting lens gives no floor for (Choi
  /// eq. 7: r ≥ F); they are left out.
  std::size_t rejectedPoints() const;
  /// Where regions of the last frame within the reach of objects begin that may be things of the floor's
  /// colour, a part of its pattern or a shadow: none of `objects`, the scan ends at them. base_link, metres.
  /// Whoever answers for missed things must know.
  const std::vector<Eigen::Vector2d>& undecided() const;
  /// Share of the visible floor's depth that was free in the last valid frame, the middle one of all
  /// bearings.
  double freeShare() const;
  /// Share of the view that shows nothing of the world; it is left out as what lies beyond the view's edge
  /// is.
  double coveredShare() const;
  /// See FrameCheck::litBeyondLens().
  double litBeyondLens() const;
  /// Metres rolled without having seen anything but floor, nor a horizon, since the beginning.
  double bare_m() const;
  /// Seconds for which nothing came before the last frame, where they are so many that it follows nothing.
  double gap_s() const;
  /// Why the last frame was not used, where its state alone does not say it; else empty.
  const char* fault() const;

 private:
  void watch(const Frame& frame, const Motion& wheels);
  void startAnew();

  struct Stages;
  struct Watch;
  std::unique_ptr<Stages> stages_;
  std::unique_ptr<Watch> watch_;
  bool is_blind_ = false;  ///< nothing is left to learn the floor from
};

}  // namespace omnifleet::local_mapper
