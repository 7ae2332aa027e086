#pragma once

#include <vector>

#include "flow/harris.h"
#include "flow/lucas_kanade.h"
#include "flow/point_tracks.h"
#include "flow/vector_filter.h"
#include "ground/labelling.h"
#include "lens/camera.h"
#include "observation/observation.h"

namespace omnifleet::flow {

struct FeatureFlowOptions {
  HarrisOptions harris;             ///< `harris`
  LucasKanadeOptions lucas_kanade;  ///< `lucas_kanade`
  VectorFilterOptions filter;       ///< `filter`
  PointOptions points;              ///< `points`
  double sigma_px = 0.15;           ///< pixels: σ of one tracked point, for the noise on the floor
  static FeatureFlowOptions read(const options::Section& section);
};

/// Choi §III.3–5 for one robot: finds corners in the labelled regions, tracks them between frames, maps them
/// to the floor point by point with the projection model of the camera (instead of eq. 6–7), removes the
/// robot's own motion, and filters per label. Difference to the paper: corners are found in the current
/// frame, whose labels they carry, and tracked back into the previous one. `from` and `to` keep the meaning
/// of the paper (previous → current).
class FeatureFlow {
 public:
  FeatureFlow(const lens::Camera& camera, const FeatureFlowOptions& options);

  /// Takes the next frame; the current frame becomes the previous one. Processes only the surroundings of
  /// `regions`: a point without a region near it in the previous frame is not tracked.
  /// @param image CV_8UC3 (BGR) or CV_8UC1; the surroundings of the regions are copied
  /// @param cells of the image, for its coarse levels
  void push(const cv::Mat& image, const CellColours& cells, const std::vector<ground::Blob>& regions);
  /// Discards the previous frame.
  void forget() {
    has_previous_ = has_current_ = false;
    points_.forget();
  }

  /// Number of tracked points that the projection cannot map to the floor (r ≥ F in Choi eq. 7) since
  /// forgetRejected().
  std::size_t rejected() const { return rejected_; }
  void forgetRejected() { rejected_ = 0; }

  /// Brightness of the last frame, in its regions and their surroundings.
  const cv::Mat1b& grey() const { return current_.grey(); }

  /// Fills vectors (with their points in space) and height of objects[i] from blobs[which[i]].
  /// @param motion base_link(previous) ← base_link(current). If not valid, identity is assumed and no height
  /// is estimated.
  void track(const std::vector<ground::Blob>& blobs, const std::vector<std::size_t>& which,
             const Motion& motion, std::vector<ObjectObservation>& objects);

 private:
  int reach(int levels) const;
  bool wasSeen(const Eigen::Vector2f& pixel) const;
  bool followCorner(const Corner& corner, const Pose2& previous_from_current, FlowVector& vector);
  double floorSigma(const Eigen::Vector2f& pixel, const Eigen::Vector2d& floor) const;
  void finish(const Motion& motion, ObjectObservation& object);

  const lens::Camera* camera_;
  FeatureFlowOptions options_;
  Harris harris_;
  LucasKanade lucas_kanade_;
  PointTracks points_;
  Pyramid previous_, current_;
  std::vector<cv::Rect> previous_seen_, current_seen_;  ///< rectangles in which points can be tracked
  std::vector<cv::Rect> built_, built_coarsely_;
  std::size_t rejected_ = 0;
  bool has_previous_ = false, has_current_ = false;
  std::vector<FlowVector> found_;
  std::vector<Displacement> displacements_, kept_;
};

}  // namespace omnifleet::flow
