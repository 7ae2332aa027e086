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
  double sigma_px = 0.15;           ///< pixels: σ of one followed point, for the noise on the floor
  static FeatureFlowOptions read(const options::Section& section);
};

/// §III.3–5 of Choi for one robot: corners in the labelled regions, followed between the frames, corrected to
/// the floor point by point with the camera's own lens (in place of eq. 6–7), own motion removed, filtered
/// per label. Departure: corners are found in the current frame, whose labels they then carry, and followed
/// back into the previous one; `from` and `to` keep the paper's sense (previous → current).
class FeatureFlow {
 public:
  FeatureFlow(const lens::Camera& camera, const FeatureFlowOptions& options);

  /// Takes the next frame; the one before becomes the previous. Only around its regions is it looked at: what
  /// had no region near it in the frame before is not followed.
  /// @param image CV_8UC3 (BGR) or CV_8UC1; copied there
  /// @param cells of the image, for its coarse levels
  void push(const cv::Mat& image, const CellColours& cells, const std::vector<ground::Blob>& regions);
  /// Forgets the previous frame.
  void forget() {
    has_previous_ = has_current_ = false;
    points_.forget();
  }

  /// Followed points that the lens has no floor for (r ≥ F in Choi eq. 7) since forgetRejected().
  std::size_t rejected() const { return rejected_; }
  void forgetRejected() { rejected_ = 0; }

  /// Brightness of the frame pushed last, in its regions and well around them.
  const cv::Mat1b& grey() const { return current_.grey(); }

  /// Fills vectors (with their points in space) and height of objects[i] from blobs[which[i]].
  /// @param motion base_link(previous) ← base_link(current); taken as identity, and no height, when not valid
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
  std::vector<cv::Rect> previous_seen_, current_seen_;  ///< pixels from which points can be followed
  std::vector<cv::Rect> built_, built_coarsely_;
  std::size_t rejected_ = 0;
  bool has_previous_ = false, has_current_ = false;
  std::vector<FlowVector> found_;
  std::vector<Displacement> displacements_, kept_;
};

}  // namespace omnifleet::flow
