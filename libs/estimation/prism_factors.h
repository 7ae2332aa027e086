#pragma once

#include <ceres/cost_function.h>

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "estimation/landmark.h"
#include "estimation/view.h"
#include "geometry/pose2.h"

namespace omnifleet::estimation {

/// Residuals of one silhouette, direction by direction: (b − prediction)·√w / σ, all as the calibration puts
/// it on the floor: on a floor that is taken for smaller, errors would be smaller and the least squares would
/// shrink the world (a laser's are metres). Subclasses say what g is.
/// Weights w are taken at the values last given to reweight() and fixed during a solve (iterative
/// reweighting): of each direction Cauchy's, so a merged or occluded part loses its vote without turning the
/// problem non-convex, times that of the whole view, Student's t with a scale common to it: 1 / (1 + u/u₀), u
/// the mean square of what is left in σ of a contour. Light, a shadow at the foot or what stands behind moves
/// an outline on one side and alike in every frame; as many independent small errors it would outvote the
/// calibration.
class PrismFactor : public ceres::CostFunction {
 public:
  /// Evaluates, weighs every direction anew; returns the rms of the unweighted residual of the
  /// usable ones on the footprint's scale, metres.
  double reweight(double const* const* parameters);
  /// Weighs the whole view by how it fits; once after each reweight().
  void discount();
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 protected:
  /// Up to `directions` of the view's usable directions, evenly thinned; the second variable's dimension.
  PrismFactor(std::shared_ptr<const View> view, int directions, int object_dimension);

  /// What all directions of a view have in common: places and turns at the values of an evaluation. Seven
  /// evaluations of a solve ask for every direction, so nothing that needs a sine stands there.
  struct Placement {
    Eigen::Vector2d observer;      ///< cosine and sine of the observer's heading
    Eigen::Vector2d to_m, foot_m;  ///< from the camera's foot to the object, and the foot from base_link; map
    Eigen::Vector2d object{1.0, 0.0};  ///< cosine and sine of the object's turn
    Eigen::Vector2d shift_m{0, 0};     ///< from the second variable's place to the object, map
    TurnedGrid corners;                ///< of the object's shape, by the view's directions
    double size = 1.0, height_m = 0.0;
  };
  /// g and its derivatives by the first two variables, and the height of what is seen.
  struct Prediction {
    double g = 0.0;
    double by_first[3] = {0, 0, 0}, by_second[4] = {0, 0, 0, 0};
    double by_size = 0.0;  ///< derivative of g by the fourth variable
    double height_m = 0.0, height_by_size = 0.0;
    bool height_is_third = false;  ///< component of the second variable
  };
  virtual Placement place(double const* const* parameters) const = 0;
  /// In a direction of the view, `n` in the map; false where g is unknown.
  virtual bool predict(const Placement& at, int direction, const Eigen::Vector2d& n,
                       Prediction& out) const = 0;

  std::shared_ptr<const View> view_;

 private:
  bool predict(const Placement& at, std::size_t row, Prediction& out) const;
  void differentiate(std::size_t row, const Prediction& p, double weight, double camera_height_m,
                     double** jacobians) const;

  std::vector<int> directions_;
  std::vector<Eigen::Vector2d> normals_;  ///< of these, base_link
  std::vector<double> root_weight_;
  double misfit_ = 0.0;  ///< mean square of the weighted residuals, in σ² of the view
};

/// Variables: observer's pose, landmark (x, y, h, turn), observer's camera error, landmark's size. The shape,
/// in the landmark's own axes, is shared with the landmark and fixed in a solve.
class LandmarkViewFactor final : public PrismFactor {
 public:
  LandmarkViewFactor(std::shared_ptr<const View> view, std::shared_ptr<const Shape> shape, int directions);

 protected:
  Placement place(double const* const* parameters) const override;
  bool predict(const Placement& at, int direction, const Eigen::Vector2d& n, Prediction& out) const override;

 private:
  std::shared_ptr<const Shape> shape_;
};

/// Variables: observer's pose, peer's pose (the peer stands at pose ∘ offset when it was seen), observer's
/// camera error, the peer's size: what its body measures, by what it is said to.
class PeerViewFactor final : public PrismFactor {
 public:
  PeerViewFactor(std::shared_ptr<const View> view, std::shared_ptr<const Body> body, const Pose2& offset,
                 int directions);

 protected:
  Placement place(double const* const* parameters) const override;
  bool predict(const Placement& at, int direction, const Eigen::Vector2d& n, Prediction& out) const override;

 private:
  std::shared_ptr<const Body> body_;
  Pose2 offset_;
};

}  // namespace omnifleet::estimation
