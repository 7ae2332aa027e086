#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "estimation/view.h"
#include "geometry/pose2.h"

namespace omnifleet::estimation {

/// The footprint of a landmark in its own frame, eliminated from the graph: given poses, every view gives the
/// footprint's support in every direction as an affine function of the object's height h,
///   h_P(n) = b + d − h·q,  d = n·c, q = b/H on the far side (b > 0), 0 on the contact side,
/// so the weighted mean over views is affine too: A(n) − h·Q(n). The graph then holds that frame and h only,
/// and stays exactly insensitive to h along directions that were always seen from the same side. The frame
/// turns as well as moves, and grows: a shape that was made of views says nothing of where north is, nor how
/// large anything is. A shape of fixed size would tell every camera how high it is.
class Shape {
 public:
  static constexpr int kDirections = SupportFunction::kDirections;

  /// Adds a view for good, from its final pose. `size`: the landmark's.
  void freeze(const View& view, const Pose2& landmark_from_base, double height_m, double size);
  /// Starts the estimate over from the frozen views, at the landmark's size; live views are added, then the
  /// means are formed.
  void begin(double size);
  void add(const View& view, const Pose2& landmark_from_base, double height_m);
  void finish();

  double a(int m) const { return a_[static_cast<std::size_t>(m)]; }
  double size() const { return size_; }
  double q(int m) const { return q_[static_cast<std::size_t>(m)]; }
  bool known(int m) const { return weight_[static_cast<std::size_t>(m)] > 0; }
  double support(int m, double height_m) const { return a(m) - height_m * q(m); }
  /// Steiner centre in the landmark's frame as an affine function of h: at − h·by_height.
  void centre(Eigen::Vector2d& at, Eigen::Vector2d& by_height) const;
  /// Mean over directions (half the mean width), likewise.
  void halfWidth(double& at, double& by_height) const;
  bool empty() const { return a_.empty(); }

 private:
  /// Centre and half width where less than nine tenths of the outline are known; false where they are.
  bool partly(Eigen::Vector2d& at, Eigen::Vector2d& by_height, double& width, double& width_by_height) const;
  struct Sums {
    std::vector<double> w, wa, wq;
    void reset();
    void add(const View& view, const Pose2& landmark_from_base, double height_m, double size,
             const Shape* reference);
  };
  double size_ = 1.0;
  Sums frozen_, sums_;  ///< wa by the size
  std::vector<double> a_, q_, weight_;
};

/// What one robot has seen of a landmark.
struct Observer {
  std::int64_t seen_ns = 0;  ///< last
  int views = 0;             ///< keyframes
  double rms_m = 0.0;        ///< of those that were in the window last: how well one prism explains them

  /// The thing is where its views say it is. (Half a thing in each view is another thing in each.)
  bool isSure() const { return views >= 3 && rms_m < 0.015; }
};

/// One obstacle in the graph.
struct Landmark {
  std::uint32_t id = 0;
  std::uint32_t variable = 0;  ///< (x, y, h, turn): map_from_landmark and the height
  std::uint32_t size = 0;      ///< variable: by how much the shape has grown since it was founded
  std::shared_ptr<Shape> shape = std::make_shared<Shape>();
  int views = 0, misfits = 0;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  ///< of x, y, h, after the last solve
  std::map<std::string, Observer> observers;
  std::int64_t last_seen_ns = 0;
};

}  // namespace omnifleet::estimation
