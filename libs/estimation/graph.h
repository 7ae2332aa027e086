#pragma once

#include <ceres/cost_function.h>

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <utility>
#include <vector>

namespace omnifleet::estimation {

using VariableId = std::uint32_t;
using FactorId = std::uint32_t;
inline constexpr FactorId kNoFactor = 0;

/// Least squares over small blocks of variables. Angles are not wrapped in the variables (factors compare
/// them modulo 2π). Everything is kept in the order of creation, and Ceres runs on one thread with Eigen's
/// sparse Cholesky, so equal input gives equal bits.
class Graph {
 public:
  VariableId addVariable(const Eigen::VectorXd& value);
  Eigen::VectorXd& value(VariableId id) { return variables_.at(id); }
  const Eigen::VectorXd& value(VariableId id) const { return variables_.at(id); }

  /// Derivatives of a variable's value by motions of everything together, a column each; no rows where it
  /// does not move. What is marginalised says of these motions, wherever it is linearised later, what it said
  /// where it was linearised first. Else the turn of everything, which no measurement between things tells,
  /// is learned from the changes of the linearisation alone (observability constraints: Huang, Mourikis,
  /// Roumeliotis 2010).
  using Motions = std::function<Eigen::MatrixXd(const Eigen::VectorXd&)>;
  void setMotions(Motions motions) { motions_ = std::move(motions); }

  /// `cauchy` > 0: scale (in σ) of a Cauchy loss on the factor as a whole.
  FactorId addFactor(std::unique_ptr<ceres::CostFunction> cost, std::vector<VariableId> variables,
                     double cauchy = 0.0);
  void removeFactor(FactorId id);
  bool hasFactor(FactorId id) const { return factors_.count(id) > 0; }
  /// Squared norm of a factor's residual, without its loss.
  double squaredNorm(FactorId id) const;

  /// Levenberg–Marquardt, at most `iterations` steps.
  void solve(int iterations);

  /// Removes variables and every factor that touches them; what those factors say about the variables that
  /// stay is kept as a dense prior (Schur complement at the present values).
  void marginalise(const std::vector<VariableId>& gone);

  /// Joint covariance of some variables, all others marginalised, in the order given.
  Eigen::MatrixXd covariance(const std::vector<VariableId>& wanted) const;

  /// Remembers what all factors but `without` say about `kept`, linearised at the present values, everything
  /// else marginalised. The graph itself stays as it is.
  void condense(const std::vector<VariableId>& kept, const std::vector<FactorId>& without);
  /// Gauss–Newton over the kept variables and those that came since, by what was remembered and the factors
  /// that came since: to first order solve() itself, at the price of the new factors alone. False, and
  /// nothing changed, where it does not apply: nothing is remembered, some of it has been taken back or
  /// marginalised since, a new factor touches another variable, or the steps do not descend.
  bool solveNewest(int iterations);
  /// covariance() as of the last successful solveNewest(), of variables that it moved.
  Eigen::MatrixXd newestCovariance(const std::vector<VariableId>& wanted) const;

  std::size_t variableCount() const { return variables_.size(); }
  std::size_t factorCount() const { return factors_.size(); }

 private:
  struct Factor {
    std::unique_ptr<ceres::CostFunction> cost;
    std::vector<VariableId> variables;
    double cauchy = 0.0;
  };
  using Offsets = std::map<VariableId, Eigen::Index>;  ///< first row of each variable in a stacked vector
  /// ½·dᵀ·h·d + gᵀ·d of the change d from `at`; newer factors and variables have ids from those given on.
  struct Condensed {
    bool valid = false;
    std::vector<VariableId> kept;
    std::set<FactorId> without;
    FactorId first_factor = 0;
    VariableId first_variable = 0;
    Eigen::MatrixXd h;
    Eigen::VectorXd g, at;
  };

  /// Adds to h and g; returns the factor's cost.
  double accumulate(const Factor& factor, const Offsets& offsets, Eigen::MatrixXd& h,
                    Eigen::VectorXd& g) const;
  void keepUnmeasured(const Factor& factor);
  bool newestVariables();
  double accumulateNewest();
  void setNewest(const Eigen::VectorXd& x);

  std::map<VariableId, Eigen::VectorXd> variables_;
  std::map<FactorId, Factor> factors_;
  Motions motions_;
  Condensed condensed_;
  Offsets newest_offsets_;  ///< of the last solveNewest()
  Eigen::MatrixXd newest_h_;
  Eigen::VectorXd newest_g_, newest_x_;
  VariableId next_variable_ = 1;
  FactorId next_factor_ = 1;
};

}  // namespace omnifleet::estimation
