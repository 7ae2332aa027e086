#pragma once

// Output of a perfect local mapper: prisms of known footprint and height from a known pose, and the errors of
// measured support functions against it. Test code only: it reads ground truth.

#include <string>
#include <vector>

#include "dataset/dataset.h"
#include "dataset/ground_truth.h"
#include "lens/camera.h"
#include "observation/observation.h"

namespace omnifleet::local_mapper::testing {

/// One object in the scene, seen from one robot at one time.
struct TrueObject {
  std::string name;
  bool is_robot = false;
  double height_m = 0.0;
  Polygon floor_m;         ///< footprint, base_link
  Polygon silhouette_m;    ///< footprint and the top's projection, convex hull, base_link, CCW
  double contact_m = 0.0;  ///< distance of the footprint from the camera foot
};

/// Silhouette on the floor from footprint and height: the top appears scaled about the foot by s = H/(H − h).
Polygon prismSilhouette(const Polygon& floor_m, double height_m, const Eigen::Vector2d& foot_m,
                        double camera_height_m);

/// All objects around `robot` at one time, in its base_link, nearest first.
std::vector<TrueObject> trueObjects(const dataset::Dataset& data, const dataset::GroundTruth& truth,
                                    const std::string& robot, TimeNs time_ns, const lens::Camera& camera);

Pose2 truePose(const dataset::GroundTruth& truth, const std::string& robot, TimeNs time_ns);

/// For each true object the index of the observation whose silhouette overlaps it best; −1: missed.
std::vector<int> match(const std::vector<TrueObject>& truth, const std::vector<ObjectObservation>& seen);

/// Measured minus true support per direction, in metres and in pixels at the supporting point.
struct SupportError {
  double metres = 0.0, pixels = 0.0;
  bool far_side = false;  ///< b ≥ 0: the projection of the top, else the contact with the floor
};
std::vector<SupportError> supportErrors(const TrueObject& truth, const ObjectObservation& seen,
                                        const lens::Camera& camera);

}  // namespace omnifleet::local_mapper::testing
