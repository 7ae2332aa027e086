#include "tracking/outline_split.h"

#include <algorithm>
#include <array>
#include <limits>

namespace omnifleet::tracking {
namespace {

constexpr int kFewest = 8;
constexpr int kFewestContact = 4;
constexpr double kNearlyAll = 0.9;
constexpr double kModelSigma_m = 0.008;  // m, model error, as in the filter
constexpr std::size_t kMost = 512;       // a median needs no more directions

/// Scale from the outline on the floor to the floor under the object: the far side shrinks by the height
/// ratio.
double shrink(double b, double height_ratio) {
  return b < 0.0 ? 1.0 : height_ratio;
}

double ratioOf(const PrismFilter& filter, double camera_height_m) {
  return camera_height_m > 0.0 ? std::clamp(1.0 - filter.height() / camera_height_m, 0.03, 1.0) : 1.0;
}

}  // namespace

int usableDirections(const View& view) {
  int count = 0;
  for (std::size_t k = 0; k < view.size(); ++k) count += view.usable(k) ? 1 : 0;
  return count;
}

bool showsContact(const View& view) {
  int count = 0;
  for (std::size_t k = 0; k < view.size(); ++k) count += view.usable(k) && view.supports.b_m[k] < 0.0 ? 1 : 0;
  return count >= kFewestContact;
}

double outlineDistance(const View& view, const PrismFilter& filter) {
  struct Difference {
    double away_m, weight;
  };
  std::array<Difference, kMost> differences;
  std::size_t count = 0;
  double half = 0.0;
  const double ratio = ratioOf(filter, view.camera_height_m);
  for (std::size_t k = 0; k < view.size() && count < kMost; ++k) {
    if (!view.usable(k)) continue;
    const double b = view.supports.b_m[k], scale = shrink(b, ratio);
    const double weight = 1.0 / (kModelSigma_m + scale * view.supports.sigma_m[k]);
    differences[count++] = {std::abs(filter.predictedSupport(view, k) - b) * scale, weight};
    half += 0.5 * weight;
  }
  if (count < kFewest) return std::numeric_limits<double>::infinity();
  std::sort(differences.begin(), differences.begin() + static_cast<std::ptrdiff_t>(count),
            [](const Difference& a, const Difference& b) { return a.away_m < b.away_m; });
  std::size_t middle = 0;
  for (double below = differences[0].weight; below < half && middle + 1 < count;)
    below += differences[++middle].weight;
  return differences[middle].away_m;
}

bool isEnclosed(const View& view, const PrismFilter& filter, double margin_m) {
  int inside = 0, all = 0;
  const double ratio = ratioOf(filter, view.camera_height_m);
  for (std::size_t k = 0; k < view.size(); ++k) {
    if (!view.usable(k)) continue;
    ++all;
    const double predicted = filter.predictedSupport(view, k);
    if ((predicted - view.supports.b_m[k]) * shrink(predicted, ratio) < margin_m) ++inside;
  }
  return all >= kFewest && inside >= kNearlyAll * all;
}

int unexplainedDirections(const View& view, const PrismFilter& filter, double unexplained_m) {
  int count = 0;
  const double ratio = ratioOf(filter, view.camera_height_m);
  for (std::size_t k = 0; k < view.size(); ++k) {
    if (!view.usable(k)) continue;
    const double predicted = filter.predictedSupport(view, k), scale = shrink(predicted, ratio);
    const double over = (view.supports.b_m[k] - predicted) * scale;
    count += over > unexplained_m + 3.0 * scale * view.supports.sigma_m[k] ? 1 : 0;
  }
  return count;
}

int splitOutline(const View& view, const std::vector<BlobOwner>& owners, double margin_m,
                 double unexplained_m, std::vector<View>& own, View& rest) {
  own.assign(owners.size(), view);
  rest = view;
  int unexplained = 0;
  for (std::size_t k = 0; k < view.size(); ++k) {
    double best = -std::numeric_limits<double>::infinity(), second = best;
    std::size_t winner = 0;
    for (std::size_t i = 0; i < owners.size(); ++i) {
      const double predicted = owners[i].expectedSupport(view, k);
      if (predicted > best) {
        second = best;
        best = predicted;
        winner = i;
      } else {
        second = std::max(second, predicted);
      }
    }
    const double scale = shrink(best, ratioOf(*owners[winner].filter, view.camera_height_m));
    const bool usable = view.usable(k);
    const double over = (view.supports.b_m[k] - best) * scale;
    const bool exceeds = usable && over > unexplained_m + 3.0 * scale * view.supports.sigma_m[k];
    // If the second outline matches the observed one better, this object is not there: it stands behind, or
    // has left.
    const double under = (best - view.supports.b_m[k]) * scale;
    const bool withdrawn = under > std::abs(second - view.supports.b_m[k]) * scale;
    const bool clear = (best - second) * scale > margin_m && !withdrawn;
    for (std::size_t i = 0; i < owners.size(); ++i) {
      if (exceeds || !clear || i != winner) own[i].supports.sigma_m[k] = -1.0F;
    }
    if (!exceeds) rest.supports.sigma_m[k] = -1.0F;
    unexplained += exceeds ? 1 : 0;
  }
  return unexplained;
}

}  // namespace omnifleet::tracking
