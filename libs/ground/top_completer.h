#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "ground/convex_part.h"
#include "ground/floor_frame.h"
#include "ground/labelling.h"
#include "lens/camera.h"

namespace omnifleet::ground {

/// Completes things lighter than the floor and of its hue. Their tops are plain to see; their sides, in less
/// light, have about the floor's brightness, a little more here and less there. Alone, such a top would be a
/// thing that floats along with the camera.
///
/// Verticals lead towards the camera's foot, so an upright thing of height h, seen from height H, shows the
/// near edge of its foot on each bearing at 1 − h/H of the floor distance that the near edge of its top
/// projects to (docs/methods.md, "Support-function prism"). Before the top of all things its sides lie up to
/// one such share, the floor from there on: the share is where what all bearings show together is parted best
/// in two, each with a brightness and a variance of its own (a change point by likelihood; Basseville and
/// Nikiforov 1993). A patch of light, and what shows its sides as well as its top, has no such share.
class TopCompleter {
 public:
  TopCompleter(const lens::Camera& camera, cv::Size image);

  /// @param region something of it is lighter than the floor and of its hue
  /// @return the pixels of top and sides, by rows, valid until the next call; empty where nothing tells both
  const std::vector<Run>& complete(const FloorFrame& frame, const Blob& region);
  /// Was the last one a top with sides, too far off for where they end to be told?
  bool isDoubtful() const { return is_doubtful_; }
  /// Did nothing of the last one but a top differ from the floor?
  bool isAlone() const { return is_alone_; }

 private:
  /// Of what all bearings show at one share: the sum of the gains; of pairs of neighbours half the squared
  /// differences.
  struct Row {
    double count = 0.0, sum = 0.0, pairs = 0.0, squares = 0.0;
  };
  /// Sums over rows.
  struct Sums {
    double count = 0.0, within = 0.0, along = 0.0;
  };
  bool findTop(const FloorFrame& frame, const Blob& region);
  bool findNearEdge();
  void measureRows(const FloorFrame& frame);
  std::optional<std::size_t> findFoot(const FloorFrame& frame);
  double noise2OfFloor(const FloorFrame& frame) const;
  double logLikelihood(std::size_t begin, std::size_t end) const;
  std::optional<Eigen::Vector2d> pixelAt(const Eigen::Vector2d& floor_m, double share) const;
  double gainAlong(const FloorFrame& frame, const Eigen::Vector2d& floor_m, double share) const;
  double metresPerPixel(double share) const;
  void take(const FloorFrame& frame, double share);
  double shareInHull(const Blob& region);
  cv::Rect drawHull();

  lens::Camera camera_;
  cv::Size size_;
  cv::Mat1f gains_;          ///< brightness of the pixels, of the floor's
  cv::Mat1b light_, whole_;  ///< 255 where it is lighter than halfway to the top; what is taken
  ConvexPart convex_;
  std::vector<float> lights_;
  cv::Rect around_;
  std::vector<cv::Point> hull_, outline_;  ///< of the top; of all
  std::vector<Eigen::Vector2d> top_m_;     ///< its outline on the floor, from the camera's foot
  std::vector<Eigen::Vector2d> near_m_;    ///< its near edge, by bearings
  std::vector<Row> rows_;                  ///< from the near edge inward
  std::vector<Sums> until_;                ///< of the rows before each
  float limit_ = 0.0f;                     ///< of the floor's light, from which something may be of the top
  bool is_doubtful_ = false, is_alone_ = false;
  bool is_cut_ = false;         ///< the view ends there
  std::vector<double> shares_;  ///< of the rows
  std::vector<Run> runs_;
};

}  // namespace omnifleet::ground
