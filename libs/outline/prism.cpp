#include "outline/prism.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "outline/half_planes.h"
#include "outline/plain_shape.h"
#include "outline/prism_terms.h"
#include "outline/vertices.h"

namespace omnifleet::outline {
namespace {

using detail::Term;
using detail::Terms;

/// Neighbouring directions share supporting points and errors, so their number overstates the information: σ
/// is doubled (docs/methods/local_mapper.md).
constexpr double kCorrelation = 4.0;
constexpr int kStartHeights = 16;

class PrismSolver {
 public:
  PrismSolver(const Terms& terms, const PrismOptions& options, const HeightPrior& prior)
      : terms_(terms), options_(options), prior_(prior), shift_(terms.views(), Eigen::Vector2d::Zero()) {
    const std::size_t cells = terms.views() * static_cast<std::size_t>(terms.directions);
    weight_.assign(cells, 0.0);
    mean_.assign(static_cast<std::size_t>(terms.directions), 0.0);
    max_height_ = options.max_height_share * detail::lowestCamera(terms);
    flat_ = !(max_height_ > 0);
  }

  void solve() {
    height_ = startHeight();
    medianMeans();
    for (int i = 0; i < options_.iterations; ++i) {
      reweight();
      const double before = height_;
      step();
      updateMeans();
      if (i > 2 && std::abs(height_ - before) < 1e-6) break;
    }
  }

  double height() const { return height_; }
  double heightSigma() const { return height_sigma_; }
  void report(PrismFit& fit, std::size_t given_views) const;
  std::vector<SupportSample> samples(const std::vector<PrismView>& views, const Polygon& footprint,
                                     double spread) const;

 private:
  std::size_t index(std::size_t v, int k) const {
    return v * static_cast<std::size_t>(terms_.directions) + static_cast<std::size_t>(k);
  }
  /// A view's value of h_P(n) at the current height and shift.
  double value(std::size_t v, int k) const {
    const Term& t = terms_.at(v, k);
    return t.a - height_ * t.b + terms_.normals[static_cast<std::size_t>(k)].dot(shift_[v]);
  }
  double startHeight();
  double disagreement() const;
  void medianMeans();
  void reweight();
  void step();
  void updateMeans();
  void reportViews(PrismFit& fit, std::size_t given_views) const;
  void reportDirections(PrismFit& fit) const;
  void addDirection(int k, Eigen::MatrixXd& normal, Eigen::VectorXd& rhs) const;

  const Terms& terms_;
  const PrismOptions& options_;
  HeightPrior prior_;
  bool flat_ = true;  ///< lasers only: no information on the height, it stays 0
  double height_ = 0.0, height_sigma_ = 0.0, max_height_ = 0.0;
  std::vector<Eigen::Vector2d> shift_;
  std::vector<double> weight_, mean_;
};

/// Sum of capped residuals about the medians at the current height, over all compared pairs.
double PrismSolver::disagreement() const {
  double sum = 0.0;
  std::vector<std::pair<double, double>> values;
  for (int k = 0; k < terms_.directions; ++k) {
    values.clear();
    for (std::size_t v = 0; v < terms_.views(); ++v) {
      if (terms_.at(v, k).sigma > 0)
        values.emplace_back(value(v, k), 1.0 / terms_.sigmaAt(v, k, height_, options_.noise_m));
    }
    if (values.size() < 2) continue;
    const double median = detail::weightedMedian(values);
    for (const auto& [h, w] : values) sum += std::min(std::abs(h - median) * w, 5.0);
  }
  return sum;
}

double PrismSolver::startHeight() {
  if (flat_) return 0.0;
  if (prior_.sigma_m > 0) return std::clamp(prior_.height_m, 0.0, max_height_);
  double best = 0.0, least = -1.0;
  for (int i = 0; i < kStartHeights; ++i) {
    height_ = max_height_ * (i + 0.5) / kStartHeights;
    const double cost = disagreement();
    if (least < 0 || cost < least) {
      least = cost;
      best = height_;
    }
  }
  return best;
}

void PrismSolver::medianMeans() {
  std::vector<std::pair<double, double>> values;
  for (int k = 0; k < terms_.directions; ++k) {
    values.clear();
    for (std::size_t v = 0; v < terms_.views(); ++v) {
      if (terms_.at(v, k).sigma > 0)
        values.emplace_back(value(v, k), 1.0 / terms_.sigmaAt(v, k, height_, options_.noise_m));
    }
    mean_[static_cast<std::size_t>(k)] = detail::weightedMedian(values);
  }
}

void PrismSolver::reweight() {
  for (std::size_t v = 0; v < terms_.views(); ++v) {
    for (int k = 0; k < terms_.directions; ++k) {
      if (terms_.at(v, k).sigma <= 0) continue;
      const double sigma = std::hypot(terms_.sigmaAt(v, k, height_, options_.noise_m), options_.pose_sigma_m);
      const double off =
          (value(v, k) - mean_[static_cast<std::size_t>(k)]) / (options_.robust_sigmas * sigma);
      const double own = terms_.sigmaAt(v, k, height_, options_.noise_m);
      weight_[index(v, k)] = 1.0 / (own * own * (1.0 + off * off));
    }
  }
}

void PrismSolver::addDirection(int k, Eigen::MatrixXd& normal, Eigen::VectorXd& rhs) const {
  double w = 0.0, wa = 0.0, wb = 0.0;
  for (std::size_t v = 0; v < terms_.views(); ++v) {
    const double weight = weight_[index(v, k)];
    w += weight, wa += weight * terms_.at(v, k).a, wb += weight * terms_.at(v, k).b;
  }
  if (w <= 0) return;
  const double mean_a = wa / w, mean_b = wb / w;
  const Eigen::Vector2d n = terms_.normals[static_cast<std::size_t>(k)];
  const Eigen::Matrix2d nn = n * n.transpose();
  for (std::size_t v = 0; v < terms_.views(); ++v) {
    const double weight = weight_[index(v, k)];
    if (weight <= 0) continue;
    const double da = terms_.at(v, k).a - mean_a, db = terms_.at(v, k).b - mean_b;
    const auto row = static_cast<Eigen::Index>(1 + 2 * v);
    normal(0, 0) += weight * db * db;
    rhs(0) += weight * db * da;
    normal.block<2, 1>(row, 0) -= weight * db * n;
    rhs.segment<2>(row) -= weight * da * n;
    normal.block<2, 2>(row, row) += weight * nn;
    for (std::size_t u = 0; u <= v; ++u) {
      const double both = weight * weight_[index(u, k)] / w;
      if (both > 0) normal.block<2, 2>(row, static_cast<Eigen::Index>(1 + 2 * u)) -= both * nn;
    }
  }
}

/// Solves for height and shifts together, with the mean of every direction eliminated.
void PrismSolver::step() {
  const auto size = static_cast<Eigen::Index>(1 + 2 * terms_.views());
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(size, size);
  Eigen::VectorXd rhs = Eigen::VectorXd::Zero(size);
  for (int k = 0; k < terms_.directions; ++k) addDirection(k, normal, rhs);
  normal /= kCorrelation;
  rhs /= kCorrelation;
  const double loose = flat_ ? 1.0 : max_height_;
  const bool known = prior_.sigma_m > 0;
  const double prior_weight = known ? 1.0 / (prior_.sigma_m * prior_.sigma_m) : 1.0 / (loose * loose);
  normal(0, 0) += prior_weight;
  rhs(0) += prior_weight * (known ? prior_.height_m : height_);
  for (Eigen::Index i = 1; i < size; ++i)
    normal(i, i) += 1.0 / (options_.pose_sigma_m * options_.pose_sigma_m);
  const Eigen::LDLT<Eigen::MatrixXd, Eigen::Lower> ldlt(normal);
  const Eigen::VectorXd solution = ldlt.solve(rhs);
  if (!solution.allFinite()) return;
  height_ = std::clamp(solution(0), 0.0, max_height_);
  for (std::size_t v = 0; v < terms_.views(); ++v)
    shift_[v] = solution.segment<2>(static_cast<Eigen::Index>(1 + 2 * v));
  if (flat_) return;
  height_sigma_ = std::sqrt(std::max(ldlt.solve(Eigen::VectorXd::Unit(size, 0))(0), 0.0));
}

void PrismSolver::updateMeans() {
  for (int k = 0; k < terms_.directions; ++k) {
    double sum = 0.0, weighted = 0.0;
    for (std::size_t v = 0; v < terms_.views(); ++v) {
      sum += weight_[index(v, k)];
      if (weight_[index(v, k)] > 0) weighted += weight_[index(v, k)] * value(v, k);
    }
    if (sum > 0) mean_[static_cast<std::size_t>(k)] = weighted / sum;
  }
}

/// Residuals per view and in total.
void PrismSolver::reportViews(PrismFit& fit, std::size_t given_views) const {
  std::vector<double> square(given_views, 0.0), count(given_views, 0.0);
  double residual = 0.0, weights = 0.0, normalised = 0.0, total = 0.0;
  for (std::size_t v = 0; v < terms_.views(); ++v) {
    const auto given = static_cast<std::size_t>(terms_.view[v]);
    for (int k = 0; k < terms_.directions; ++k) {
      const double w = weight_[index(v, k)];
      if (w <= 0) continue;
      const double r = value(v, k) - mean_[static_cast<std::size_t>(k)];
      const double sigma = std::hypot(terms_.sigmaAt(v, k, height_, options_.noise_m), options_.pose_sigma_m);
      residual += w * r * r, weights += w;
      normalised += r * r / (sigma * sigma), total += 1.0;
      square[given] += r * r, count[given] += 1.0;
    }
  }
  fit.rms_m = weights > 0 ? std::sqrt(residual / weights) : 0.0;
  fit.spread = total > 0 ? std::sqrt(normalised / total) : 0.0;
  fit.view_rms_m.assign(given_views, -1.0);
  for (std::size_t v = 0; v < given_views; ++v) {
    if (count[v] > 0) fit.view_rms_m[v] = std::sqrt(square[v] / count[v]);
  }
}

/// The averages, and the derivative of the centre by the height: −2/K Σ mean(b) n.
void PrismSolver::reportDirections(PrismFit& fit) const {
  const auto count = static_cast<double>(terms_.directions);
  Eigen::Vector2d centre_per_height = Eigen::Vector2d::Zero();
  for (int k = 0; k < terms_.directions; ++k) {
    DirectionEvidence evidence;
    double sum = 0.0, b = 0.0;
    for (std::size_t v = 0; v < terms_.views(); ++v) {
      const double w = weight_[index(v, k)], sigma = terms_.sigmaAt(v, k, height_, options_.noise_m);
      sum += w;
      b += w * terms_.at(v, k).b;
      if (w * sigma * sigma > 0.3) ++evidence.views;
    }
    if (sum > 0) {
      evidence.support_m = mean_[static_cast<std::size_t>(k)];
      evidence.sigma_m = 1.0 / std::sqrt(sum);
      fit.coverage += 1.0 / count;
      centre_per_height -= (2.0 / count) * (b / sum) * terms_.normals[static_cast<std::size_t>(k)];
    }
    fit.evidence.push_back(evidence);
  }
  fit.height_m = height_;
  fit.height_sigma_m = height_sigma_;
  fit.covariance = height_sigma_ * height_sigma_ * centre_per_height * centre_per_height.transpose();
}

void PrismSolver::report(PrismFit& fit, std::size_t given_views) const {
  reportViews(fit, given_views);
  reportDirections(fit);
}

/// All views' own directions at the estimated height and shifts, weighted by their agreement with a
/// footprint.
std::vector<SupportSample> PrismSolver::samples(const std::vector<PrismView>& views, const Polygon& footprint,
                                                double spread) const {
  std::vector<SupportSample> all;
  const double noise_scale = kCorrelation * std::max(1.0, spread * spread);
  for (std::size_t v = 0; v < terms_.views(); ++v) {
    const PrismView& view = views[static_cast<std::size_t>(terms_.view[v])];
    const Eigen::Vector2d foot = view.map_from_base * view.foot_m + shift_[v];
    for (std::size_t k = 0; k < view.supports.size(); ++k) {
      const double b = view.supports.b_m[k], given = view.supports.sigma_m[k];
      if (!(given > 0) || !std::isfinite(b) || !std::isfinite(given)) continue;
      const double angle = view.map_from_base.theta_rad +
                           2.0 * M_PI * static_cast<double>(k) / static_cast<double>(view.supports.size());
      const Eigen::Vector2d n(std::cos(angle), std::sin(angle));
      const double q = view.perHeight(b), scale = q != 0 ? 1.0 - height_ / view.camera_height_m : 1.0;
      const double support = n.dot(foot) + scale * b;
      const double sigma = std::hypot(scale * given, options_.noise_m);
      const double off = (support - detail::supportOf(footprint, n)) /
                         (options_.robust_sigmas * std::hypot(sigma, options_.pose_sigma_m));
      all.push_back({angle, support, 1.0 / (sigma * sigma * noise_scale * (1.0 + off * off))});
    }
  }
  return all;
}

/// Replaces many half-planes by few vertices. Keeps the footprint if the result differs too much.
void sharpen(const PrismSolver& solver, const std::vector<PrismView>& views, const PrismOptions& options,
             PrismFit& fit) {
  if (fit.footprint_m.size() < 3 || options.vertex_penalty <= 0) return;
  for (int round = 0; round < 2; ++round) {
    const auto samples = solver.samples(views, fit.footprint_m, fit.spread);
    const Polygon sharp = polygonOfSamples(samples, centroid(fit.footprint_m), options.vertex_penalty);
    constexpr double kSame = 0.6;
    if (sharp.size() < 3 || convexIou(sharp, fit.footprint_m) < kSame) return;
    fit.footprint_m = sharp;
  }
}

/// Replaces the free outline by a rectangle or a disc if it explains the views equally well with fewer
/// parameters. Replaces an open free outline if the shape is certain by itself. Returns true if replaced.
bool simplify(const detail::PlainProblem& problem, const PrismOptions& options, PrismFit& fit) {
  constexpr double kSure_m = 0.03;
  if (!options.plain_shapes || options.vertex_penalty <= 0) return false;
  const detail::PlainFit plain = detail::fitPlainShape(problem, options, fit.height_m);
  if (!plain.valid) return false;
  const double price = 0.5 * options.vertex_penalty;
  if (fit.footprint_m.size() >= 3) {
    const double free = detail::costOfOutline(problem, options, fit.footprint_m, fit.height_m) +
                        price * (2.0 * static_cast<double>(fit.footprint_m.size()) + 1.0);
    if (plain.cost + price * plain.parameters > free) return false;
  } else if (std::sqrt(plain.covariance.trace()) > kSure_m || plain.size_sigma_m > kSure_m ||
             fit.coverage < options.min_coverage) {
    return false;
  }
  fit.footprint_m = plain.outline_m;
  fit.height_m = plain.height_m;
  fit.height_sigma_m = plain.height_sigma_m;
  fit.covariance = plain.covariance;
  return true;
}

/// Steiner point of a polygon, on the directions of the evidence. It is computed about a vertex: the sum over
/// evenly spread directions is exact for a shift, and small numbers stay exact.
Eigen::Vector2d steinerPointOf(const Polygon& polygon, std::size_t directions) {
  const auto count = static_cast<double>(directions);
  const Eigen::Vector2d origin = polygon.front();
  Eigen::Vector2d centre = origin;
  for (std::size_t k = 0; k < directions; ++k) {
    const double angle = 2.0 * M_PI * static_cast<double>(k) / count;
    const Eigen::Vector2d n(std::cos(angle), std::sin(angle));
    centre += (2.0 / count) * (detail::supportOf(polygon, n) - n.dot(origin)) * n;
  }
  return centre;
}

/// Covariance of the centre from the noise of the directions and the poses of the views.
Eigen::Matrix2d centreCovariance(const PrismFit& fit, const PrismOptions& options, std::size_t views) {
  const auto count = static_cast<double>(fit.evidence.size());
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
  for (std::size_t k = 0; k < fit.evidence.size(); ++k) {
    const double angle = 2.0 * M_PI * static_cast<double>(k) / count;
    const Eigen::Vector2d n(std::cos(angle), std::sin(angle));
    covariance +=
        4.0 / (count * count) * fit.evidence[k].sigma_m * fit.evidence[k].sigma_m * n * n.transpose();
  }
  const double pose_variance =
      options.pose_sigma_m * options.pose_sigma_m / static_cast<double>(std::max<std::size_t>(views, 1));
  return kCorrelation * covariance + pose_variance * Eigen::Matrix2d::Identity();
}

/// Sets the polygon, its Steiner point, and the evidence about it.
void closeOutline(const PrismSolver& solver, const std::vector<PrismView>& given, const PrismOptions& options,
                  const detail::PlainProblem& problem, PrismFit& fit) {
  if (detail::widestGap(fit.evidence) <= options.max_gap_deg * M_PI / 180.0) {
    fit.footprint_m = detail::polygonOf(fit.evidence);
    sharpen(solver, given, options, fit);
  }
  if (!simplify(problem, options, fit)) {
    if (fit.footprint_m.size() < 3) return;
    fit.covariance += centreCovariance(fit, options, problem.camera_height_m.size());
  }
  fit.centre_m = steinerPointOf(fit.footprint_m, fit.evidence.size());
  for (std::size_t k = 0; k < fit.evidence.size(); ++k) {
    const double angle = 2.0 * M_PI * static_cast<double>(k) / static_cast<double>(fit.evidence.size());
    fit.evidence[k].support_m -= fit.centre_m.dot(Eigen::Vector2d(std::cos(angle), std::sin(angle)));
  }
  fit.valid = true;
}

/// Height from the tangents of the views, for views that differ too little to be compared.
HeightPrior priorFromTangents(const Terms& terms, double max_height_m) {
  double weight = 0.0, sum = 0.0;
  for (std::size_t v = 0; v < terms.views(); ++v) {
    const HeightPrior one = detail::heightByTangents(terms, v);
    if (one.sigma_m <= 0) continue;
    const double sigma = std::hypot(one.sigma_m, 0.02);
    weight += 1.0 / (sigma * sigma);
    sum += std::clamp(one.height_m, 0.0, max_height_m) / (sigma * sigma);
  }
  // The tangents have a common bias from the shape, so their number does not reduce σ below 2 cm.
  return weight > 0 ? HeightPrior{sum / weight, std::hypot(1.0 / std::sqrt(weight), 0.02)} : HeightPrior{};
}

}  // namespace

PrismFit fitPrism(const std::vector<PrismView>& views, const PrismOptions& options,
                  const HeightPrior& prior) {
  PrismFit fit;
  const Terms all = detail::termsOf(views, options.directions, options.noise_m);
  if (all.views() == 0) return fit;
  const Terms terms = detail::mostInformative(all, views, static_cast<std::size_t>(options.max_views));
  const double max_height = options.max_height_share * detail::lowestCamera(terms);
  const detail::PlainProblem problem = detail::plainProblem(views, terms.view, max_height, prior);
  PrismSolver first(terms, options, prior);
  first.solve();
  constexpr double kVague = 0.05;  // m, σ of a height from which the tangents are used
  if (first.heightSigma() <= kVague || prior.sigma_m > 0 || terms.top_faces_only) {
    first.report(fit, views.size());
    closeOutline(first, views, options, problem, fit);
    return fit;
  }
  const HeightPrior tangents = priorFromTangents(terms, max_height);
  PrismSolver second(terms, options, tangents);
  second.solve();
  second.report(fit, views.size());
  if (tangents.sigma_m <= 0) fit.height_sigma_m = 0.0;
  closeOutline(second, views, options, problem, fit);
  return fit;
}

}  // namespace omnifleet::outline
