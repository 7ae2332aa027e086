#include "markers/template_model.h"

#include <algorithm>
#include <cmath>

#include "geometry/wide.h"

namespace omnifleet::markers {
namespace {

/// Makes room for count rows. Memory is kept from marker to marker.
void reserve(Eigen::ArrayXf& array, Eigen::Index count) {
  if (array.size() < count) array.resize((count + 255) / 256 * 256);
}

/// An edge at `at`, blurred by the B-spline: its value, its derivative by the place and by the logarithm of
/// the width. The B-spline is the convolution of three boxes.
OMNIFLEET_WIDE void blurEdge(const float* place, Eigen::Index count, float at, float per_width, float* step,
                             float* slope, float* widening) {
#pragma GCC ivdep
  for (Eigen::Index k = 0; k < count; ++k) {
    const float t = (place[k] - at) * per_width;
    const float distance = std::abs(t);
    const float a = std::max(1.5F - distance, 0.0F), b = std::max(0.5F - distance, 0.0F);
    const float density = 0.5F * a * a - 1.5F * b * b;
    const float rest = a * a * a * (1.0F / 6.0F) - 0.5F * b * b * b;
    step[k] = t < 0.0F ? rest : 1.0F - rest;
    slope[k] = density * per_width;
    widening[k] = -t * density;
  }
}

OMNIFLEET_WIDE void subtract(const float* a, const float* b, Eigen::Index count, float* to) {
#pragma GCC ivdep
  for (Eigen::Index k = 0; k < count; ++k) to[k] = a[k] - b[k];
}

/// The blurred values of an interval, per pixel.
struct Blurred {
  const float *value, *d_place, *d_spread;
};

/// Adds the product of two blurred intervals, with its derivatives.
OMNIFLEET_WIDE void addProduct(float sign, Blurred x, Blurred y, Eigen::Index count, float* value, float* du,
                               float* dv, float* d_log_sigma) {
#pragma GCC ivdep
  for (Eigen::Index k = 0; k < count; ++k) {
    value[k] += sign * (x.value[k] * y.value[k]);
    du[k] += sign * (x.d_place[k] * y.value[k]);
    dv[k] += sign * (x.value[k] * y.d_place[k]);
    d_log_sigma[k] += sign * (x.d_spread[k] * y.value[k] + x.value[k] * y.d_spread[k]);
  }
}

}  // namespace

TemplateModel::TemplateModel(const std::vector<Rectangle>& painted)
    : regions_(static_cast<Eigen::Index>(painted.size())) {
  // Region i = rectangle i − union of the later ones: the sum over all subsets of the later ones of
  // (−1)^size · their intersection with rectangle i.
  for (std::size_t i = 0; i < painted.size(); ++i) {
    const std::size_t later = painted.size() - i - 1;
    for (std::size_t subset = 0; subset < std::size_t{1} << later; ++subset) {
      Eigen::Array2d low = painted[i].centre_m - painted[i].half_m,
                     high = painted[i].centre_m + painted[i].half_m;
      float sign = 1.0F;
      for (std::size_t k = 0; k < later; ++k) {
        if ((subset >> k & 1) == 0) continue;
        const Rectangle& r = painted[i + 1 + k];
        low = low.max((r.centre_m - r.half_m).array());
        high = high.min((r.centre_m + r.half_m).array());
        sign = -sign;
      }
      if ((high > low).all())
        terms_.push_back({static_cast<Eigen::Index>(i), sign, x_.interval(low.x(), high.x()),
                          y_.interval(low.y(), high.y())});
    }
  }
  // Terms with equal rectangles and opposite signs cancel.
  for (std::size_t i = 0; i < terms_.size(); ++i) {
    for (std::size_t k = i + 1; k < terms_.size(); ++k) {
      const Term &a = terms_[i], &b = terms_[k];
      if (a.region != b.region || a.sign == b.sign || a.x != b.x || a.y != b.y) continue;
      terms_.erase(terms_.begin() + static_cast<std::ptrdiff_t>(k));
      terms_.erase(terms_.begin() + static_cast<std::ptrdiff_t>(i--));
      break;
    }
  }
}

double TemplateModel::area(Eigen::Index region) const {
  double sum = 0.0;
  for (const Term& term : terms_) {
    const auto& [left, right] = x_.intervals[term.x];
    const auto& [low, high] = y_.intervals[term.y];
    if (term.region == region)
      sum += static_cast<double>(term.sign) * (x_.edges[right] - x_.edges[left]) *
             (y_.edges[high] - y_.edges[low]);
  }
  return sum;
}

std::size_t TemplateModel::Axis::edge(double at) {
  for (std::size_t i = 0; i < edges.size(); ++i)
    if (std::abs(edges[i] - at) < 1e-9) return i;
  edges.push_back(at);
  step.emplace_back(), slope.emplace_back(), widening.emplace_back();
  return edges.size() - 1;
}

std::size_t TemplateModel::Axis::interval(double low, double high) {
  const std::pair<std::size_t, std::size_t> wanted{edge(low), edge(high)};
  const auto found = std::find(intervals.begin(), intervals.end(), wanted);
  if (found != intervals.end()) return static_cast<std::size_t>(found - intervals.begin());
  intervals.push_back(wanted);
  value.emplace_back(), d_place.emplace_back(), d_spread.emplace_back();
  return intervals.size() - 1;
}

void TemplateModel::Axis::evaluate(const Eigen::ArrayXf& place, Eigen::Index count, double sigma_m) {
  const float per_width = static_cast<float>(0.5 / sigma_m);  // the variance of the B-spline is width²/4
  for (std::size_t i = 0; i < edges.size(); ++i) {
    reserve(step[i], count), reserve(slope[i], count), reserve(widening[i], count);
    blurEdge(place.data(), count, static_cast<float>(edges[i]), per_width, step[i].data(), slope[i].data(),
             widening[i].data());
  }
  for (std::size_t i = 0; i < intervals.size(); ++i) {
    const auto [low, high] = intervals[i];
    reserve(value[i], count), reserve(d_place[i], count), reserve(d_spread[i], count);
    subtract(step[low].data(), step[high].data(), count, value[i].data());
    subtract(slope[low].data(), slope[high].data(), count, d_place[i].data());
    subtract(widening[low].data(), widening[high].data(), count, d_spread[i].data());
  }
}

void TemplateModel::evaluate(const Eigen::ArrayXf& u, const Eigen::ArrayXf& v, Eigen::Index count,
                             const Eigen::Vector2d& sigma_m, Coverage& coverage) {
  x_.evaluate(u, count, sigma_m.x());
  y_.evaluate(v, count, sigma_m.y());
  for (Eigen::ArrayXXf* part : {&coverage.value, &coverage.du, &coverage.dv, &coverage.d_log_sigma}) {
    if (part->rows() < count || part->cols() != regions_) part->resize((count + 255) / 256 * 256, regions_);
    part->topRows(count).setZero();
  }
  const auto of = [](const Axis& axis, std::size_t i) {
    return Blurred{axis.value[i].data(), axis.d_place[i].data(), axis.d_spread[i].data()};
  };
  for (const Term& term : terms_) {
    addProduct(term.sign, of(x_, term.x), of(y_, term.y), count, coverage.value.col(term.region).data(),
               coverage.du.col(term.region).data(), coverage.dv.col(term.region).data(),
               coverage.d_log_sigma.col(term.region).data());
  }
}

}  // namespace omnifleet::markers
