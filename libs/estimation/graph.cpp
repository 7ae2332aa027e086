#include "estimation/graph.h"

#include <ceres/ceres.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "estimation/factors.h"

namespace omnifleet::estimation {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Square root of a positive semidefinite H with S ᵀS = H, and r0 with Sᵀr0 = g.
void squareRoot(const Eigen::MatrixXd& h, const Eigen::VectorXd& g, Eigen::MatrixXd& s, Eigen::VectorXd& r0) {
  const Eigen::LDLT<Eigen::MatrixXd> ldlt(h);
  const double largest = ldlt.vectorD().maxCoeff();
  Eigen::VectorXd root(h.rows()), inverse(h.rows());
  for (Eigen::Index i = 0; i < h.rows(); ++i) {
    const double d = ldlt.vectorD()(i);
    const bool positive = d > 1e-12 * largest;
    root(i) = positive ? std::sqrt(d) : 0.0;
    inverse(i) = positive ? 1.0 / std::sqrt(d) : 0.0;
  }
  // Not `matrixU() * transpositionsP()`: from the right Eigen applies the swaps in the other order, that is
  // Pᵀ.
  const Eigen::MatrixXd p = ldlt.transpositionsP() * Eigen::MatrixXd::Identity(h.rows(), h.cols());
  const Eigen::MatrixXd upper = ldlt.matrixU();
  s = root.asDiagonal() * (upper * p);
  Eigen::VectorXd pg = ldlt.transpositionsP() * g;
  r0 = inverse.cwiseProduct(ldlt.matrixL().solve(pg));
}

}  // namespace

VariableId Graph::addVariable(const Eigen::VectorXd& value) {
  variables_.emplace(next_variable_, value);
  return next_variable_++;
}

FactorId Graph::addFactor(std::unique_ptr<ceres::CostFunction> cost, std::vector<VariableId> variables,
                          double cauchy) {
  factors_.emplace(next_factor_, Factor{std::move(cost), std::move(variables), cauchy});
  return next_factor_++;
}

double Graph::squaredNorm(FactorId id) const {
  const Factor& factor = factors_.at(id);
  std::vector<const double*> blocks;
  for (VariableId v : factor.variables) blocks.push_back(variables_.at(v).data());
  Eigen::VectorXd r(factor.cost->num_residuals());
  factor.cost->Evaluate(blocks.data(), r.data(), nullptr);
  return r.squaredNorm();
}

void Graph::solve(int iterations) {
  ceres::Problem::Options keep;
  keep.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  keep.disable_all_safety_checks = true;
  ceres::Problem problem(keep);
  for (auto& [id, value] : variables_)
    problem.AddParameterBlock(value.data(), static_cast<int>(value.size()));
  for (auto& [id, factor] : factors_) {
    std::vector<double*> blocks;
    for (VariableId v : factor.variables) blocks.push_back(variables_.at(v).data());
    ceres::LossFunction* loss = factor.cauchy > 0 ? new ceres::CauchyLoss(factor.cauchy) : nullptr;
    problem.AddResidualBlock(factor.cost.get(), loss, blocks);
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;
  options.num_threads = 1;
  options.max_num_iterations = iterations;
  options.function_tolerance = 1e-12;
  options.initial_trust_region_radius = 1e8;  // as good as Gauss–Newton: starts are near
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
}

void Graph::accumulate(const Factor& factor, const Offsets& offsets, Eigen::MatrixXd& h,
                       Eigen::VectorXd& g) const {
  const int rows = factor.cost->num_residuals();
  const std::size_t blocks = factor.variables.size();
  std::vector<RowMajor> jacobians(blocks);
  std::vector<const double*> values(blocks);
  std::vector<double*> outputs(blocks);
  for (std::size_t i = 0; i < blocks; ++i) {
    const Eigen::VectorXd& value = variables_.at(factor.variables[i]);
    values[i] = value.data();
    jacobians[i].resize(rows, value.size());
    outputs[i] = jacobians[i].data();
  }
  Eigen::VectorXd r(rows);
  factor.cost->Evaluate(values.data(), r.data(), outputs.data());
  const double weight =
      factor.cauchy > 0 ? 1.0 / (1.0 + r.squaredNorm() / (factor.cauchy * factor.cauchy)) : 1.0;
  for (std::size_t i = 0; i < blocks; ++i) {
    const Eigen::Index at = offsets.at(factor.variables[i]), size = jacobians[i].cols();
    g.segment(at, size) += weight * jacobians[i].transpose() * r;
    for (std::size_t j = 0; j < blocks; ++j) {
      const Eigen::Index to = offsets.at(factor.variables[j]);
      h.block(at, to, size, jacobians[j].cols()) += weight * jacobians[i].transpose() * jacobians[j];
    }
  }
}

void Graph::marginalise(const std::vector<VariableId>& gone) {
  const std::set<VariableId> leaving(gone.begin(), gone.end());
  std::vector<FactorId> touching;
  std::set<VariableId> connected;
  for (const auto& [id, factor] : factors_) {
    const bool touches = std::any_of(factor.variables.begin(), factor.variables.end(),
                                     [&](VariableId v) { return leaving.count(v) > 0; });
    if (!touches) continue;
    touching.push_back(id);
    connected.insert(factor.variables.begin(), factor.variables.end());
  }
  std::vector<VariableId> staying;
  Offsets offsets;
  Eigen::Index out = 0, size = 0;
  for (VariableId v : leaving) {
    offsets[v] = out;
    out += variables_.at(v).size();
  }
  size = out;
  for (VariableId v : connected) {
    if (leaving.count(v) > 0) continue;
    staying.push_back(v);
    offsets[v] = size;
    size += variables_.at(v).size();
  }
  Eigen::MatrixXd h = Eigen::MatrixXd::Zero(size, size);
  Eigen::VectorXd g = Eigen::VectorXd::Zero(size);
  for (FactorId id : touching) accumulate(factors_.at(id), offsets, h, g);
  for (FactorId id : touching) factors_.erase(id);
  const Eigen::Index in = size - out;
  if (in > 0) {
    const auto hmm = h.topLeftCorner(out, out);
    const Eigen::LDLT<Eigen::MatrixXd> ldlt(hmm);
    const Eigen::MatrixXd gain = ldlt.solve(h.topRightCorner(out, in));
    const Eigen::MatrixXd schur = h.bottomRightCorner(in, in) - h.bottomLeftCorner(in, out) * gain;
    const Eigen::VectorXd rest = g.tail(in) - gain.transpose() * g.head(out);
    Eigen::MatrixXd s;
    Eigen::VectorXd r0;
    squareRoot(0.5 * (schur + schur.transpose()), rest, s, r0);
    std::vector<Eigen::VectorXd> at;
    for (VariableId v : staying) at.push_back(variables_.at(v));
    addFactor(std::make_unique<DensePrior>(std::move(s), std::move(r0), std::move(at)), staying);
  }
  for (VariableId v : leaving) variables_.erase(v);
}

Eigen::MatrixXd Graph::covariance(const std::vector<VariableId>& wanted) const {
  Offsets offsets;
  Eigen::Index size = 0;
  for (const auto& [id, value] : variables_) {
    offsets[id] = size;
    size += value.size();
  }
  Eigen::MatrixXd h = Eigen::MatrixXd::Zero(size, size);
  Eigen::VectorXd g = Eigen::VectorXd::Zero(size);
  for (const auto& [id, factor] : factors_) accumulate(factor, offsets, h, g);
  h.diagonal().array() += 1e-9;  // variables nobody constrains yet
  Eigen::Index columns = 0;
  for (VariableId v : wanted) columns += variables_.at(v).size();
  Eigen::MatrixXd selection = Eigen::MatrixXd::Zero(size, columns);
  Eigen::Index column = 0;
  for (VariableId v : wanted) {
    for (Eigen::Index i = 0; i < variables_.at(v).size(); ++i) selection(offsets.at(v) + i, column++) = 1.0;
  }
  return selection.transpose() * h.llt().solve(selection);
}

}  // namespace omnifleet::estimation
