#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <vector>

#include "distance_vector/bearing_sampler.h"
#include "distance_vector/column_edges.h"
#include "distance_vector/column_view.h"
#include "distance_vector/edge_fusion.h"
#include "distance_vector/floor_colour.h"
#include "distance_vector/floor_split.h"
#include "distance_vector/floor_walk.h"
#include "distance_vector/options.h"
#include "distance_vector/smoothed_image.h"
#include "distance_vector/weak_edges.h"
#include "lens/camera.h"
#include "observation/boundary.h"
#include "observation/observation.h"

namespace omnifleet::distance_vector {

/// The distance vector of Ahmed et al. 2013, §2.1: the boundary of the floor in the image of a forward
/// camera, per image column, and from it the distance of what ends the floor, per bearing. Deviations from
/// the paper (method `projected`): edges are sub-pixel, each boundary pixel is projected by the calibration,
/// and each distance has a σ. The paper's equations 1–5 are the method `literal`. See
/// docs/methods/distance_vector.md.
class DistanceVector {
 public:
  enum class Fault {
    kNone,
    /// What the bottom of the image shows reaches above the horizon, or ends nowhere, or drifts to another
    /// colour without an edge (sky).
    kNoFloor,
    kTooNear  ///< the floor known from earlier frames is hidden
  };

  /// Throws options::Error if the camera does not look at the floor or the scale file is unusable.
  DistanceVector(const lens::Camera& camera, const Options& options);

  /// @param bgr CV_8UC3 of the camera's size; throws std::invalid_argument otherwise. Results are valid until
  /// the next call. Deterministic function of the images so far; allocates nothing after the first frames.
  void process(const cv::Mat& bgr);

  /// Inverse range and σ (1/m) per bearing where an edge ends the floor; base_link axes, origin at the
  /// camera's foot (method literal: at base_link).
  const Boundary& boundary() const { return sampler_.boundary(); }
  /// One ray per bearing of the boundary. kObstacle: an edge ends the floor. kFloorEnd: floor up to the
  /// farthest distance that is measured. kInvalid: not in view, undecided, or no edge measured.
  const Scan& scan() const { return sampler_.scan(); }
  Fault fault() const { return fault_; }

  /// CV_8UC1 of the camera's size, 255 on floor (Fig. 1c).
  const cv::Mat& floorMask() const { return mask_; }
  /// Per image column the row of the boundary, sub-pixel; NaN: none (Fig. 1d).
  const std::vector<float>& edgeRows() const { return edge_rows_; }
  /// Per image column what ends the floor.
  const std::vector<ColumnEnd>& columnEnds() const { return ends_; }

 private:
  struct Scale {
    std::function<std::optional<double>(double)> ceiling_px;  ///< eq. 2; empty outside of the fitted interval
    double sigma_alpha = 0.0;
  };
  static Scale makeScale(const LiteralOptions& options);

  bool findFloor(const cv::Mat& bgr);
  bool measureEdges(const cv::Mat& bgr);
  void splitColumns(const FloorSample& sample, bool is_known);
  bool isPlausible(const std::vector<ColumnEnd>& ends) const;
  void drawMask();
  void project();
  void scaleLiterally();

  Options options_;
  Eigen::Vector2d foot_m_;
  ColumnView view_;
  SmoothedImage smoothed_;
  FloorColour colour_;
  FloorWalk walk_;
  FloorSplit split_;
  ColumnEdges edges_;
  EdgeFusion fusion_;
  WeakEdges weak_edges_;
  BearingSampler sampler_;
  Scale scale_;
  std::vector<ColumnEnd> ends_;
  std::vector<ColumnEdges::Pair> pairs_;
  std::vector<ColumnHit> hits_;
  std::vector<float> edge_rows_;
  std::vector<int> floor_tops_;
  cv::Mat mask_;
  Fault fault_ = Fault::kNoFloor;
  int new_floor_frames_ = 0;
};

}  // namespace omnifleet::distance_vector
