#include "estimation/graph.h"

#include <ceres/ceres.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <utility>

#include "estimation/factors.h"

namespace omnifleet::estimation {
namespace {

// Of the largest information of a prior that is condensed: less is taken for rounding. Stiff steps (0.1 mm,
// 1e8 m⁻²) cancel in it, and noise taken for a measurement moves by its residual over its own root.
constexpr double kLeastInformation = 1e-9;
constexpr double kLoose = 1e-9;  // information of variables that nobody constrains yet

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Square root of a positive semidefinite H with S ᵀS = H, and r0 with Sᵀr0 = g.
void squareRoot(const Eigen::MatrixXd& h, const Eigen::VectorXd& g, Eigen::MatrixXd& s, Eigen::VectorXd& r0) {
  const Eigen::LDLT<Eigen::MatrixXd> ldlt(h);
  const double largest = ldlt.vectorD().maxCoeff();
  Eigen::VectorXd root(h.rows()), inverse(h.rows());
  for (Eigen::Index i = 0; i < h.rows(); ++i) {
    const double d = ldlt.vectorD()(i);
    const bool positive = d > kLeastInformation * largest;
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

void Graph::removeFactor(FactorId id) {
  if (id < condensed_.first_factor && condensed_.without.count(id) == 0 && hasFactor(id))
    condensed_.valid = false;
  factors_.erase(id);
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

double Graph::accumulate(const Factor& factor, const Offsets& offsets, Eigen::MatrixXd& h,
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
  const double squares = r.squaredNorm(), scale = factor.cauchy * factor.cauchy;
  const double weight = factor.cauchy > 0 ? 1.0 / (1.0 + squares / scale) : 1.0;
  for (std::size_t i = 0; i < blocks; ++i) {
    const Eigen::Index at = offsets.at(factor.variables[i]), size = jacobians[i].cols();
    g.segment(at, size) += weight * jacobians[i].transpose() * r;
    for (std::size_t j = 0; j < blocks; ++j) {
      const Eigen::Index to = offsets.at(factor.variables[j]);
      h.block(at, to, size, jacobians[j].cols()) += weight * jacobians[i].transpose() * jacobians[j];
    }
  }
  return 0.5 * (factor.cauchy > 0 ? scale * std::log1p(squares / scale) : squares);
}

/// Where a dense prior is linearised anew, its S is changed as little as makes S·G(now) = S·G(then), G the
/// motions: what it says of them stays.
void Graph::keepUnmeasured(const Factor& factor) {
  auto* prior = dynamic_cast<DensePrior*>(factor.cost.get());
  if (prior == nullptr || !motions_) return;
  std::vector<Eigen::VectorXd> at;
  for (VariableId v : factor.variables) at.push_back(variables_.at(v));
  Eigen::MatrixXd then, now;
  Eigen::Index row = 0;
  for (std::size_t i = 0; i < at.size(); ++i) {
    const Eigen::MatrixXd g = motions_(at[i]);
    if (g.rows() > 0 && now.rows() == 0) then = now = Eigen::MatrixXd::Zero(prior->s().cols(), g.cols());
    if (g.rows() > 0) {
      now.middleRows(row, g.rows()) = g;
      then.middleRows(row, g.rows()) = motions_(prior->at()[i]);
    }
    row += at[i].size();
  }
  if (now.rows() == 0) return;
  const Eigen::MatrixXd normal = now.transpose() * now;
  const Eigen::MatrixXd inverse = normal.completeOrthogonalDecomposition().solve(now.transpose());
  prior->relinearise(std::move(at), prior->s() - prior->s() * (now - then) * inverse);
}

void Graph::marginalise(const std::vector<VariableId>& gone) {
  const std::set<VariableId> leaving(gone.begin(), gone.end());
  condensed_.valid = false;
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
  for (FactorId id : touching) {
    keepUnmeasured(factors_.at(id));
    accumulate(factors_.at(id), offsets, h, g);
  }
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
  h.diagonal().array() += kLoose;
  Eigen::Index columns = 0;
  for (VariableId v : wanted) columns += variables_.at(v).size();
  Eigen::MatrixXd selection = Eigen::MatrixXd::Zero(size, columns);
  Eigen::Index column = 0;
  for (VariableId v : wanted) {
    for (Eigen::Index i = 0; i < variables_.at(v).size(); ++i) selection(offsets.at(v) + i, column++) = 1.0;
  }
  return selection.transpose() * h.llt().solve(selection);
}

void Graph::condense(const std::vector<VariableId>& kept, const std::vector<FactorId>& without) {
  condensed_.kept = kept;
  condensed_.without = {without.begin(), without.end()};
  condensed_.first_factor = next_factor_;
  condensed_.first_variable = next_variable_;
  const std::set<VariableId> staying(kept.begin(), kept.end());
  Offsets offsets;
  Eigen::Index out = 0;
  for (const auto& [id, value] : variables_) {
    if (staying.count(id) > 0) continue;
    offsets[id] = out;
    out += value.size();
  }
  Eigen::Index size = out;
  for (VariableId v : kept) {
    offsets[v] = size;
    size += variables_.at(v).size();
  }
  const Eigen::Index in = size - out;
  Eigen::MatrixXd h = Eigen::MatrixXd::Zero(size, size);
  Eigen::VectorXd g = Eigen::VectorXd::Zero(size);
  for (const auto& [id, factor] : factors_) {
    if (condensed_.without.count(id) == 0) accumulate(factor, offsets, h, g);
  }
  h.diagonal().array() += kLoose;
  const Eigen::LLT<Eigen::MatrixXd> llt(h.topLeftCorner(out, out));
  condensed_.valid = llt.info() == Eigen::Success;
  if (!condensed_.valid) return;
  const Eigen::MatrixXd half = llt.matrixL().solve(h.topRightCorner(out, in));
  const Eigen::VectorXd half_g = llt.matrixL().solve(g.head(out));
  condensed_.h = h.bottomRightCorner(in, in);
  condensed_.h.noalias() -= half.transpose() * half;
  condensed_.g = g.tail(in) - half.transpose() * half_g;
  condensed_.at.resize(in);
  for (VariableId v : kept)
    condensed_.at.segment(offsets.at(v) - out, variables_.at(v).size()) = variables_.at(v);
}

/// Rows of the variables that solveNewest() moves, those kept first; false where it does not apply.
bool Graph::newestVariables() {
  if (!condensed_.valid) return false;
  newest_offsets_.clear();
  Eigen::Index size = 0;
  for (VariableId v : condensed_.kept) {
    newest_offsets_[v] = size;
    size += variables_.at(v).size();
  }
  for (auto at = variables_.lower_bound(condensed_.first_variable); at != variables_.end(); ++at) {
    newest_offsets_[at->first] = size;
    size += at->second.size();
  }
  newest_x_.resize(size);
  for (const auto& [id, row] : newest_offsets_)
    newest_x_.segment(row, variables_.at(id).size()) = variables_.at(id);
  return std::all_of(factors_.lower_bound(condensed_.first_factor), factors_.end(),
                     [this](const auto& entry) {
                       const auto& v = entry.second.variables;
                       return std::all_of(v.begin(), v.end(),
                                          [this](VariableId id) { return newest_offsets_.count(id) > 0; });
                     });
}

/// Normal equations at the present values; returns the cost.
double Graph::accumulateNewest() {
  const Eigen::Index kept = condensed_.at.size(), size = newest_x_.size();
  newest_h_.setZero(size, size);
  newest_g_.setZero(size);
  Eigen::VectorXd change(kept);
  for (VariableId v : condensed_.kept) {
    const Eigen::Index row = newest_offsets_.at(v), n = variables_.at(v).size();
    change.segment(row, n) = variables_.at(v) - condensed_.at.segment(row, n);
  }
  newest_h_.topLeftCorner(kept, kept) = condensed_.h;
  const Eigen::VectorXd by_change = condensed_.h * change;
  newest_g_.head(kept) = condensed_.g + by_change;
  double cost = change.dot(condensed_.g + 0.5 * by_change);
  for (auto at = factors_.lower_bound(condensed_.first_factor); at != factors_.end(); ++at)
    cost += accumulate(at->second, newest_offsets_, newest_h_, newest_g_);
  newest_h_.diagonal().array() += kLoose;
  return cost;
}

void Graph::setNewest(const Eigen::VectorXd& x) {
  for (const auto& [id, row] : newest_offsets_) {
    Eigen::VectorXd& value = variables_.at(id);
    value = x.segment(row, value.size());
  }
}

bool Graph::solveNewest(int iterations) {
  if (!newestVariables()) return false;
  const Eigen::VectorXd start = newest_x_;
  const double before = accumulateNewest();
  double cost = before;
  for (int i = 0; i < iterations && std::isfinite(cost); ++i) {
    const Eigen::LLT<Eigen::MatrixXd> llt(newest_h_);
    if (llt.info() != Eigen::Success) break;
    newest_x_ -= llt.solve(newest_g_);
    setNewest(newest_x_);
    cost = accumulateNewest();
  }
  if (cost <= before + 1e-9 * (1.0 + std::abs(before))) return true;
  setNewest(start);
  return false;
}

Eigen::MatrixXd Graph::newestCovariance(const std::vector<VariableId>& wanted) const {
  Eigen::Index columns = 0;
  for (VariableId v : wanted) columns += variables_.at(v).size();
  Eigen::MatrixXd selection = Eigen::MatrixXd::Zero(newest_h_.rows(), columns);
  Eigen::Index column = 0;
  for (VariableId v : wanted) {
    for (Eigen::Index i = 0; i < variables_.at(v).size(); ++i)
      selection(newest_offsets_.at(v) + i, column++) = 1.0;
  }
  return selection.transpose() * newest_h_.llt().solve(selection);
}

}  // namespace omnifleet::estimation
