#include "outline/plain_shape.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "outline/prism_terms.h"

namespace omnifleet::outline::detail {
namespace {

constexpr double kCorrelation = 4.0;  // as in fitPrism
constexpr std::size_t kMostSamples = 1000;
constexpr int kTurns = 6, kFirstIterations = 5, kLastIterations = 10;
constexpr double kLeastHalf_m = 0.01;
constexpr int kDiscVertices = 48;
constexpr int kMostParameters = 6;
using Matrix = Eigen::Matrix<double, kMostParameters, kMostParameters>;
using Vector = Eigen::Matrix<double, kMostParameters, 1>;

/// Disc: centre, height, radius. Rectangle: centre, height, half lengths, orientation.
struct Shape {
  bool is_disc = true;
  Vector p = Vector::Zero();  ///< x, y, h, r | x, y, h, u, w, θ

  int size() const { return is_disc ? 4 : 6; }
  double height() const { return p(2); }
  /// Support in a direction and its derivatives (the derivative by h is left 0).
  double support(const Eigen::Vector2d& n, Vector& by) const {
    by.setZero();
    by(0) = n.x();
    by(1) = n.y();
    if (is_disc) {
      by(3) = 1.0;
      return n.dot(p.head<2>()) + p(3);
    }
    const double c = std::cos(p(5)), s = std::sin(p(5));
    const double along = c * n.x() + s * n.y(), across = c * n.y() - s * n.x();
    by(3) = std::abs(along);
    by(4) = std::abs(across);
    by(5) = p(3) * std::copysign(1.0, along) * across - p(4) * std::copysign(1.0, across) * along;
    return n.dot(p.head<2>()) + p(3) * by(3) + p(4) * by(4);
  }
  Polygon outline() const {
    Polygon polygon;
    if (is_disc) {
      for (int k = 0; k < kDiscVertices; ++k) {
        const double phi = 2.0 * M_PI * k / kDiscVertices;
        polygon.push_back(p.head<2>() + p(3) * Eigen::Vector2d(std::cos(phi), std::sin(phi)));
      }
      return polygon;
    }
    const Eigen::Rotation2Dd turn(p(5));
    for (const auto& [x, y] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, 1}})
      polygon.push_back(p.head<2>() + turn * Eigen::Vector2d(x * p(3), y * p(4)));
    return polygon;
  }
};

/// Robust weighting of a residual: its variance, and the squared residual from which it loses weight.
struct Scale {
  double variance, limit;
  double cost(double residual) const { return limit / variance * std::log1p(residual * residual / limit); }
  double weight(double residual) const { return 1.0 / (variance * (1.0 + residual * residual / limit)); }
};

Scale scaleOf(const PlainSample& s, const PlainProblem& problem, const PrismOptions& o, double height_m) {
  const double scale = s.q != 0 ? std::max(1.0 - height_m / problem.camera_height_m[s.view], 0.05) : 1.0;
  const double variance = std::pow(scale * s.sigma, 2) + o.noise_m * o.noise_m;
  const double limit = o.robust_sigmas * o.robust_sigmas * (variance + o.pose_sigma_m * o.pose_sigma_m);
  return {variance, limit};
}

/// One view's part of the normal equations: coupling of its shift to the shape, and the shift's own block.
struct ViewPart {
  Eigen::Matrix<double, kMostParameters, 2> cross = Eigen::Matrix<double, kMostParameters, 2>::Zero();
  Eigen::Matrix2d own = Eigen::Matrix2d::Zero();
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
};

class Fitter {
 public:
  Fitter(const PlainProblem& problem, const PrismOptions& options, const Shape& start)
      : problem_(problem),
        options_(options),
        shape_(start),
        shift_(problem.camera_height_m.size(), Eigen::Vector2d::Zero()) {}

  void iterate(int times) {
    for (int i = 0; i < times; ++i) step();
  }
  double cost() const;
  const Shape& shape() const { return shape_; }
  const Matrix& information() const { return information_; }

 private:
  void step();
  void accumulate(Matrix& normal, Vector& right);
  void apply(const Vector& by);

  const PlainProblem& problem_;
  const PrismOptions& options_;
  Shape shape_;
  std::vector<Eigen::Vector2d> shift_;
  std::vector<ViewPart> parts_;
  Matrix information_ = Matrix::Identity();
};

void Fitter::accumulate(Matrix& normal, Vector& right) {
  normal.setZero();
  right.setZero();
  parts_.assign(shift_.size(), ViewPart{});
  Vector row;
  for (const PlainSample& s : problem_.samples) {
    const double support = shape_.support(s.normal, row);
    row(2) = s.q;
    const double residual = s.a - shape_.height() * s.q + s.normal.dot(shift_[s.view]) - support;
    const double weight = scaleOf(s, problem_, options_, shape_.height()).weight(residual) / kCorrelation;
    ViewPart& part = parts_[s.view];
    normal.noalias() += weight * row * row.transpose();
    right += weight * residual * row;
    part.cross.noalias() -= weight * row * s.normal.transpose();
    part.own.noalias() += weight * s.normal * s.normal.transpose();
    part.right -= weight * residual * s.normal;
  }
  if (problem_.prior.sigma_m > 0) {
    const double weight = 1.0 / (problem_.prior.sigma_m * problem_.prior.sigma_m);
    normal(2, 2) += weight;
    right(2) += weight * (problem_.prior.height_m - shape_.height());
  }
}

void Fitter::step() {
  Matrix normal;
  Vector right;
  accumulate(normal, right);
  const double stiff = 1.0 / (options_.pose_sigma_m * options_.pose_sigma_m);
  for (std::size_t v = 0; v < parts_.size(); ++v) {
    ViewPart& part = parts_[v];
    part.own += stiff * Eigen::Matrix2d::Identity();
    part.right -= stiff * shift_[v];
    const Eigen::Matrix2d inverse = part.own.inverse();
    normal -= part.cross * inverse * part.cross.transpose();
    right -= part.cross * inverse * part.right;
  }
  for (int i = shape_.size(); i < kMostParameters; ++i) normal(i, i) = 1.0;
  normal.diagonal().array() += 1e-6;
  information_ = normal;
  const Vector by = normal.ldlt().solve(right);
  if (by.allFinite()) apply(by);
}

void Fitter::apply(const Vector& by) {
  constexpr double kMostStep_m = 0.10, kMostTurn_rad = 0.3;
  Vector held = by.cwiseMin(kMostStep_m).cwiseMax(-kMostStep_m);
  if (!shape_.is_disc) held(5) = std::clamp(by(5), -kMostTurn_rad, kMostTurn_rad);
  shape_.p.head(shape_.size()) += held.head(shape_.size());
  shape_.p(2) = std::clamp(shape_.p(2), 0.0, problem_.max_height_m);
  shape_.p(3) = std::max(shape_.p(3), kLeastHalf_m);
  if (!shape_.is_disc) shape_.p(4) = std::max(shape_.p(4), kLeastHalf_m);
  for (std::size_t v = 0; v < parts_.size(); ++v) {
    const ViewPart& part = parts_[v];
    shift_[v] += part.own.inverse() * (part.right - part.cross.transpose() * held);
  }
}

double Fitter::cost() const {
  double sum = 0.0;
  Vector row;
  for (const PlainSample& s : problem_.samples) {
    const double residual =
        s.a - shape_.height() * s.q + s.normal.dot(shift_[s.view]) - shape_.support(s.normal, row);
    sum += scaleOf(s, problem_, options_, shape_.height()).cost(residual) / kCorrelation;
  }
  for (const auto& shift : shift_) sum += shift.squaredNorm() / std::pow(options_.pose_sigma_m, 2);
  if (problem_.prior.sigma_m > 0)
    sum += std::pow((problem_.prior.height_m - shape_.height()) / problem_.prior.sigma_m, 2);
  return sum;
}

/// Least-squares circle at a height, the initial shape of every fit.
bool startDisc(const PlainProblem& problem, double height_m, Shape& disc) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const PlainSample& s : problem.samples) {
    const Eigen::Vector3d row(s.normal.x(), s.normal.y(), 1.0);
    const double weight = 1.0 / (s.sigma * s.sigma);
    normal += weight * row * row.transpose();
    right += weight * (s.a - height_m * s.q) * row;
  }
  const Eigen::Vector3d solution = normal.ldlt().solve(right);
  if (!solution.allFinite() || solution(2) < kLeastHalf_m) return false;
  disc.p << solution(0), solution(1), height_m, solution(2), 0.0, 0.0;
  return true;
}

PlainFit fitOf(const Fitter& fitter, const PlainProblem& problem) {
  const Shape& shape = fitter.shape();
  PlainFit fit;
  fit.valid = shape.p.allFinite();
  fit.outline_m = shape.outline();
  fit.cost = fitter.cost();
  fit.parameters = shape.size();
  fit.height_m = shape.height();
  const Matrix covariance = fitter.information().inverse();
  fit.covariance = covariance.topLeftCorner<2, 2>();
  fit.height_sigma_m = std::min(std::sqrt(std::max(covariance(2, 2), 0.0)), problem.max_height_m);
  fit.size_sigma_m = std::sqrt(std::max(covariance(3, 3), shape.is_disc ? 0.0 : covariance(4, 4)));
  return fit;
}

}  // namespace

PlainProblem plainProblem(const std::vector<PrismView>& views, const std::vector<int>& chosen,
                          double max_height_m, const HeightPrior& prior) {
  PlainProblem problem;
  problem.max_height_m = max_height_m;
  problem.prior = prior;
  std::size_t total = 0;
  for (const int index : chosen) total += views[static_cast<std::size_t>(index)].supports.size();
  const std::size_t stride = (total + kMostSamples - 1) / kMostSamples;
  for (const int index : chosen) {
    const PrismView& view = views[static_cast<std::size_t>(index)];
    const Eigen::Vector2d foot = view.map_from_base * view.foot_m;
    const std::size_t number = problem.camera_height_m.size();
    for (std::size_t k = number % stride; k < view.supports.size(); k += stride) {
      const double b = view.supports.b_m[k], sigma = view.supports.sigma_m[k];
      if (!(sigma > 0) || !std::isfinite(b) || !std::isfinite(sigma)) continue;
      const double angle = view.map_from_base.theta_rad +
                           2.0 * M_PI * static_cast<double>(k) / static_cast<double>(view.supports.size());
      const Eigen::Vector2d n(std::cos(angle), std::sin(angle));
      const double q = view.perHeight(b);
      problem.samples.push_back({number, n, n.dot(foot) + b, q, sigma});
    }
    problem.camera_height_m.push_back(view.camera_height_m);
  }
  return problem;
}

PlainFit fitPlainShape(const PlainProblem& problem, const PrismOptions& options, double start_height_m) {
  Shape disc;
  if (problem.samples.size() < 2 * kMostParameters || !startDisc(problem, start_height_m, disc)) return {};
  Fitter round(problem, options, disc);
  round.iterate(kLastIterations);
  PlainFit best = fitOf(round, problem);
  const double price = 0.5 * options.vertex_penalty;
  Shape rectangle;
  rectangle.is_disc = false;
  double least = -1.0;
  Fitter box(problem, options, rectangle);
  for (int turn = 0; turn < kTurns; ++turn) {
    Shape start = rectangle;
    start.p << disc.p(0), disc.p(1), disc.p(2), 0.9 * disc.p(3), 0.85 * disc.p(3), 0.5 * M_PI * turn / kTurns;
    Fitter tried(problem, options, start);
    tried.iterate(kFirstIterations);
    const double cost = tried.cost();
    if (least >= 0.0 && cost >= least) continue;
    least = cost;
    rectangle = tried.shape();
  }
  Fitter last(problem, options, rectangle);
  last.iterate(kLastIterations);
  const PlainFit cornered = fitOf(last, problem);
  if (cornered.valid &&
      (!best.valid || cornered.cost + price * cornered.parameters < best.cost + price * best.parameters)) {
    best = cornered;
  }
  return best;
}

double costOfOutline(const PlainProblem& problem, const PrismOptions& options, const Polygon& outline_m,
                     double height_m) {
  std::vector<double> residual;
  for (const PlainSample& s : problem.samples)
    residual.push_back(s.a - height_m * s.q - supportOf(outline_m, s.normal));
  std::vector<Eigen::Vector2d> shift(problem.camera_height_m.size(), Eigen::Vector2d::Zero());
  const double stiff = 1.0 / (options.pose_sigma_m * options.pose_sigma_m);
  std::vector<ViewPart> parts;
  for (int round = 0; round < 4; ++round) {
    parts.assign(shift.size(), ViewPart{});
    for (std::size_t i = 0; i < residual.size(); ++i) {
      const PlainSample& s = problem.samples[i];
      const double off = residual[i] + s.normal.dot(shift[s.view]);
      const double weight = scaleOf(s, problem, options, height_m).weight(off) / kCorrelation;
      parts[s.view].own += weight * s.normal * s.normal.transpose();
      parts[s.view].right -= weight * residual[i] * s.normal;
    }
    for (std::size_t v = 0; v < shift.size(); ++v)
      shift[v] = (parts[v].own + stiff * Eigen::Matrix2d::Identity()).inverse() * parts[v].right;
  }
  double sum = 0.0;
  for (std::size_t i = 0; i < residual.size(); ++i) {
    const PlainSample& s = problem.samples[i];
    sum +=
        scaleOf(s, problem, options, height_m).cost(residual[i] + s.normal.dot(shift[s.view])) / kCorrelation;
  }
  for (const auto& t : shift) sum += stiff * t.squaredNorm();
  if (problem.prior.sigma_m > 0)
    sum += std::pow((problem.prior.height_m - height_m) / problem.prior.sigma_m, 2);
  return sum;
}

}  // namespace omnifleet::outline::detail
