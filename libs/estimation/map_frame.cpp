#include "estimation/map_frame.h"

#include <Eigen/Dense>
#include <cmath>
#include <utility>
#include <vector>

#include "estimation/factors.h"

namespace omnifleet::estimation {
namespace {

constexpr double kExact = 1e-4;         // m, rad: σ of what is so by definition
constexpr std::size_t kLeast = 3;       // points that hold the frame, …
constexpr double kLeastSpread_m = 0.5;  // … rms distance from their middle
constexpr double kModel_m = 0.05;       // σ below which no point counts for more than another

struct Network {
  std::vector<VariableId> variables;
  std::vector<Eigen::VectorXd> at;
  std::vector<double> weight;  ///< sum 1
  Eigen::Vector2d middle_m = Eigen::Vector2d::Zero();
  double spread_m = 0.0;
};

Network networkOf(const FleetState& fleet) {
  Network n;
  double sum = 0.0;
  for (const auto& [name, point] : fleet.points) {
    n.variables.push_back(point.variable);
    n.at.push_back(fleet.graph.value(point.variable));
    n.weight.push_back(1.0 / (kModel_m * kModel_m + 0.5 * point.covariance.trace()));
    sum += n.weight.back();
  }
  for (double& w : n.weight) w /= sum;
  for (std::size_t i = 0; i < n.at.size(); ++i) n.middle_m += n.weight[i] * n.at[i];
  double squares = 0.0;
  for (std::size_t i = 0; i < n.at.size(); ++i) squares += n.weight[i] * (n.at[i] - n.middle_m).squaredNorm();
  n.spread_m = std::sqrt(squares);
  return n;
}

/// The weighted mean of the points' changes is zero, and so is their turn about their middle.
std::unique_ptr<ceres::CostFunction> innerConstraints(Network n) {
  Eigen::MatrixXd s(3, 2 * static_cast<Eigen::Index>(n.at.size()));
  for (std::size_t i = 0; i < n.at.size(); ++i) {
    const Eigen::Vector2d arm = (n.at[i] - n.middle_m) / n.spread_m;
    auto block = s.middleCols<2>(2 * static_cast<Eigen::Index>(i));
    block << n.weight[i], 0.0, 0.0, n.weight[i], -n.weight[i] * arm.y(), n.weight[i] * arm.x();
  }
  return std::make_unique<DensePrior>(s / kExact, Eigen::VectorXd::Zero(3), std::move(n.at));
}

}  // namespace

Eigen::MatrixXd commonMotions(const Eigen::VectorXd& value) {
  constexpr Eigen::Index kPoint = 2, kPose = 3, kLandmark = 4;
  const Eigen::Index size = value.size();
  if (size != kPoint && size != kPose && size != kLandmark) return {};
  Eigen::MatrixXd g = Eigen::MatrixXd::Zero(size, 3);
  g.topLeftCorner<2, 2>().setIdentity();
  g.col(2).head<2>() << -value.y(), value.x();
  if (size != kPoint) g(size - 1, 2) = 1.0;
  return g;
}

void foundMap(FleetState& fleet, VariableId pose, const Pose2& start_from_base,
              const Eigen::Matrix3d& covariance) {
  MapFrame& frame = fleet.map_frame;
  frame.start = fleet.graph.addVariable(Eigen::Vector3d::Zero());
  frame.by_start = fleet.graph.addFactor(
      priorFactor(Eigen::Vector3d::Zero(), Eigen::Vector3d::Constant(kExact)), {frame.start});
  fleet.graph.addFactor(relativePoseFactor(start_from_base, covariance), {frame.start, pose});
  ++frame.datum;
}

void releaseFrame(FleetState& fleet) {
  if (fleet.map_frame.by_points != kNoFactor) fleet.graph.removeFactor(fleet.map_frame.by_points);
  fleet.map_frame.by_points = kNoFactor;
}

void holdFrame(FleetState& fleet) {
  MapFrame& frame = fleet.map_frame;
  if (frame.start == 0) return;
  Network network = networkOf(fleet);
  const bool holds = network.at.size() >= kLeast && network.spread_m >= kLeastSpread_m;
  if (!holds && frame.by_start == kNoFactor) {  // all but forgotten: where the start is now, it stays
    const Eigen::VectorXd at = fleet.graph.value(frame.start);
    frame.by_start = fleet.graph.addFactor(priorFactor(at, Eigen::Vector3d::Constant(kExact)), {frame.start});
    ++frame.datum;
  }
  if (!holds) return;
  if (frame.by_start != kNoFactor) {
    fleet.graph.removeFactor(frame.by_start);
    ++frame.datum;
  }
  frame.by_start = kNoFactor;
  std::vector<VariableId> variables = network.variables;
  frame.by_points = fleet.graph.addFactor(innerConstraints(std::move(network)), std::move(variables));
}

}  // namespace omnifleet::estimation
