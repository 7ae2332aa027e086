#include "distance_vector/scale_fit.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include "options/options.h"

namespace omnifleet::distance_vector {
namespace {

constexpr int kMostDegree = 8;

/// Legendre polynomials P₀…P_degree at x in [−1, 1].
Eigen::VectorXd legendre(double x, int degree) {
  Eigen::VectorXd p = Eigen::VectorXd::Ones(degree + 1);
  if (degree > 0) p[1] = x;
  for (int n = 1; n < degree; ++n) p[n + 1] = ((2 * n + 1) * x * p[n] - n * p[n - 1]) / (n + 1);
  return p;
}

struct Solution {
  Eigen::VectorXd coefficients;
  double leave_one_out = 0.0;  ///< RMS
};

/// Least squares by QR. The leave-one-out residual of pair i is its residual ÷ (1 − h_i) with the leverage h.
Solution solve(const std::vector<ScalePair>& pairs, double min_px, double max_px, int degree) {
  const auto n = static_cast<Eigen::Index>(pairs.size());
  Eigen::MatrixXd a(n, degree + 1);
  Eigen::VectorXd y(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const ScalePair& pair = pairs[static_cast<std::size_t>(i)];
    a.row(i) = legendre(2.0 * (pair.robot_px - min_px) / (max_px - min_px) - 1.0, degree).transpose();
    y[i] = pair.alpha();
  }
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(a);
  Solution solution;
  solution.coefficients = qr.solve(y);
  const Eigen::MatrixXd q = qr.householderQ() * Eigen::MatrixXd::Identity(n, degree + 1);
  const Eigen::VectorXd residual = y - a * solution.coefficients;
  double sum = 0.0;
  for (Eigen::Index i = 0; i < n; ++i) {
    const double left = residual[i] / std::max(1e-9, 1.0 - q.row(i).squaredNorm());
    sum += left * left;
  }
  solution.leave_one_out = std::sqrt(sum / static_cast<double>(n));
  return solution;
}

double parsed(const std::string& field, const std::string& path, int line) {
  std::size_t used = 0;
  double value = 0.0;
  try {
    value = std::stod(field, &used);
  } catch (const std::exception&) {
    used = 0;
  }
  const bool rest_is_blank = used > 0 && field.find_first_not_of(" \t\r", used) == std::string::npos;
  if (!rest_is_blank || !std::isfinite(value) || !(value > 0.0))
    throw options::Error(fmt::format("{}:{}: '{}' must be a positive number of pixels", path, line, field));
  return value;
}

}  // namespace

const std::vector<ScalePair>& paperTable() {
  static const std::vector<ScalePair> kTable{{62, 74},  {69, 83},   {75, 91},   {81, 100},  {85, 106},
                                             {93, 119}, {101, 138}, {108, 170}, {114, 199}, {121, 254}};
  return kTable;
}

std::optional<double> paperAlpha(double robot_px) {
  const double d = robot_px;
  if (!(d >= paperTable().front().robot_px && d <= paperTable().back().robot_px)) return std::nullopt;
  return 0.0051 + d * (0.028 + d * (0.00011 + d * (-7e-6 + d * 4.4e-8)));
}

ScaleFit::ScaleFit(std::vector<ScalePair> pairs, std::optional<int> degree) : pairs_(std::move(pairs)) {
  for (const ScalePair& pair : pairs_) {
    if (!(std::isfinite(pair.robot_px) && std::isfinite(pair.ceiling_px) && pair.robot_px > 0.0 &&
          pair.ceiling_px > 0.0))
      throw options::Error("pairs: distances must be positive, finite numbers of pixels");
  }
  if (degree && (*degree < 0 || *degree > kMostDegree))
    throw options::Error(fmt::format("degree: {} must be 0–{}", *degree, kMostDegree));
  std::sort(pairs_.begin(), pairs_.end(),
            [](const ScalePair& a, const ScalePair& b) { return a.robot_px < b.robot_px; });
  int distinct = pairs_.empty() ? 0 : 1;
  for (std::size_t i = 1; i < pairs_.size(); ++i)
    distinct += pairs_[i].robot_px > pairs_[i - 1].robot_px ? 1 : 0;
  const int needed = degree.value_or(0) + 2;
  if (distinct < needed)
    throw options::Error(
        fmt::format("pairs: {} different distances; a polynomial of degree {} needs {} at least", distinct,
                    degree.value_or(0), needed));
  min_px_ = pairs_.front().robot_px;
  max_px_ = pairs_.back().robot_px;
  Solution best;
  const int from = degree.value_or(0), to = degree.value_or(std::min(kPaperDegree, distinct - 2));
  for (int d = from; d <= to; ++d) {
    Solution solution = solve(pairs_, min_px_, max_px_, d);
    if (d == from || solution.leave_one_out < best.leave_one_out) best = std::move(solution);
  }
  coefficients_.assign(best.coefficients.data(), best.coefficients.data() + best.coefficients.size());
  leave_one_out_ = best.leave_one_out;
}

double ScaleFit::value(double robot_px) const {
  const Eigen::VectorXd p = legendre(2.0 * (robot_px - min_px_) / (max_px_ - min_px_) - 1.0, degree());
  return p.dot(Eigen::Map<const Eigen::VectorXd>(coefficients_.data(), p.size()));
}

std::optional<double> ScaleFit::alpha(double robot_px) const {
  if (!(robot_px >= min_px_ && robot_px <= max_px_)) return std::nullopt;
  return value(robot_px);
}

std::optional<double> ScaleFit::ceilingPx(double robot_px) const {
  const auto scale = alpha(robot_px);
  if (!scale) return std::nullopt;
  return *scale * robot_px;
}

double ScaleFit::ceilingSlope(double robot_px) const {
  const double step = 0.25;
  return ((robot_px + step) * value(robot_px + step) - (robot_px - step) * value(robot_px - step)) /
         (2.0 * step);
}

std::vector<double> ScaleFit::residuals() const {
  std::vector<double> residuals;
  for (const ScalePair& pair : pairs_) residuals.push_back(pair.alpha() - value(pair.robot_px));
  return residuals;
}

double ScaleFit::sigma() const {
  double sum = 0.0;
  for (const double residual : residuals()) sum += residual * residual;
  const auto freedom = static_cast<double>(pairs_.size() - coefficients_.size());
  return std::sqrt(sum / std::max(1.0, freedom));
}

std::vector<double> ScaleFit::powers() const {
  // P_{n+1} = ((2n+1)·x·P_n − n·P_{n−1})/(n+1) on coefficient vectors, with x = a + b·d.
  const double b = 2.0 / (max_px_ - min_px_), a = -1.0 - b * min_px_;
  const std::size_t n = coefficients_.size();
  std::vector<std::vector<double>> p(n, std::vector<double>(n, 0.0));
  p[0][0] = 1.0;
  std::vector<double> sum(n, 0.0);
  for (std::size_t k = 0; k < n; ++k) {
    if (k > 0) {
      const auto m = static_cast<double>(k - 1);
      for (std::size_t i = 0; i < n; ++i) {
        const double x_times = a * p[k - 1][i] + (i > 0 ? b * p[k - 1][i - 1] : 0.0);
        p[k][i] = ((2.0 * m + 1.0) * x_times - (k > 1 ? m * p[k - 2][i] : 0.0)) / (m + 1.0);
      }
    }
    for (std::size_t i = 0; i < n; ++i) sum[i] += coefficients_[k] * p[k][i];
  }
  return sum;
}

std::vector<ScalePair> ScaleFit::readPairs(const std::string& csv_path) {
  std::ifstream file(csv_path);
  if (!file) throw options::Error(fmt::format("{}: cannot read this file", csv_path));
  std::vector<ScalePair> pairs;
  int number = 0;
  for (std::string line; std::getline(file, line);) {
    ++number;
    const std::size_t first = line.find_first_not_of(" \t\r");
    if (first == std::string::npos || line[first] == '#') continue;
    if (line.find("d_robot_px") != std::string::npos) continue;
    const std::size_t comma = line.find(',');
    if (comma == std::string::npos || line.find(',', comma + 1) != std::string::npos)
      throw options::Error(
          fmt::format("{}:{}: two columns expected: d_robot_px,d_ceiling_px", csv_path, number));
    pairs.push_back(
        {parsed(line.substr(0, comma), csv_path, number), parsed(line.substr(comma + 1), csv_path, number)});
  }
  if (pairs.empty())
    throw options::Error(fmt::format("{}: no rows; expected d_robot_px,d_ceiling_px", csv_path));
  return pairs;
}

ScaleFit ScaleFit::load(const std::string& path) {
  const options::Section section = options::Section::load(path);
  std::vector<double> robot, ceiling;
  int degree = kPaperDegree;
  section.require("d_robot_px", robot, options::kPositive);
  section.require("d_ceiling_px", ceiling, options::kPositive);
  section.require("degree", degree, options::Range{0, kMostDegree});
  if (robot.size() != ceiling.size()) section.fail("d_ceiling_px", "must have as many values as d_robot_px");
  std::vector<double> ignored;
  section.read("alpha_powers", ignored);
  section.read("interval_px", ignored);
  section.finish();
  std::vector<ScalePair> pairs;
  for (std::size_t i = 0; i < robot.size(); ++i) pairs.push_back({robot[i], ceiling[i]});
  return ScaleFit(std::move(pairs), degree);
}

std::string ScaleFit::toYaml() const {
  std::ostringstream robot, ceiling, power;
  for (std::size_t i = 0; i < pairs_.size(); ++i) {
    robot << (i ? ", " : "") << fmt::format("{}", pairs_[i].robot_px);
    ceiling << (i ? ", " : "") << fmt::format("{}", pairs_[i].ceiling_px);
  }
  const std::vector<double> all = powers();
  for (std::size_t i = 0; i < all.size(); ++i) power << (i ? ", " : "") << fmt::format("{:.9g}", all[i]);
  return fmt::format(
      "# Scale of Ahmed et al. 2013, eq. 1: alpha(d) = d_ceiling/d_robot as a polynomial of the pairs "
      "below.\n"
      "degree: {}\ninterval_px: [{}, {}]  # outside of it alpha is refused\n"
      "alpha_powers: [{}]  # of d^0, d^1, ..., for information; the fit is repeated from the pairs\n"
      "d_robot_px: [{}]\nd_ceiling_px: [{}]\n",
      degree(), min_px_, max_px_, power.str(), robot.str(), ceiling.str());
}

}  // namespace omnifleet::distance_vector
