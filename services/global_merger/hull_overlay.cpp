#include "global_merger/hull_overlay.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <tuple>

#include "outline/half_planes.h"
#include "outline/polygon_set.h"

namespace omnifleet::global_merger {
namespace {

constexpr double kSharedPart = 0.1;

struct PlacedHull {
  const ObjectView* view;
  Polygon hull_m;
};

/// Views of one object.
struct HullStack {
  std::vector<PlacedHull> hulls;
  ObjectKind kind = ObjectKind::kUnknown;
  Polygon common_m;  ///< convex: region common to its hulls, without those that share nothing with the rest
};

/// The intersection of two convex polygons.
Polygon shared(const Polygon& a, const Polygon& b) {
  Polygon rest = a;
  for (std::size_t i = 0; i < b.size() && rest.size() >= 3; ++i) {
    const Eigen::Vector2d along = b[(i + 1) % b.size()] - b[i], outward(along.y(), -along.x());
    rest = outline::clip(rest, {outward, outward.dot(b[i])});
  }
  return rest.size() >= 3 ? rest : Polygon{};
}

bool isPlacedEarlier(const PlacedHull& a, const PlacedHull& b) {
  return std::tie(a.view->time_ns, a.view->robot, a.view->track_id) <
         std::tie(b.view->time_ns, b.view->robot, b.view->track_id);
}

/// Hulls ordered by robot, so that the few that are used come from all robots.
Polygon overlaid(const std::vector<PlacedHull>& hulls, double share) {
  const std::size_t n = std::min(hulls.size(), kMaxHulls);
  std::vector<std::vector<Polygon>> maps;
  for (std::size_t i = 0; i < n; ++i) maps.push_back({hulls[i * hulls.size() / n].hull_m});
  // If they do not all meet: the region that most of them cover.
  for (int votes = std::max(1, static_cast<int>(std::ceil(share * static_cast<double>(n)))); votes > 0;
       --votes) {
    const auto regions = outline::overlay(maps, votes);
    const auto largest = std::max_element(regions.begin(), regions.end(),
                                          [](const auto& a, const auto& b) { return a.area() < b.area(); });
    if (largest != regions.end()) return largest->outer;
  }
  return {};
}

bool overlaps(const HullStack& a, const HullStack& b) {
  const double smaller = std::min(signedArea(a.common_m), signedArea(b.common_m));
  return smaller > 0.0 && outline::convexIntersectionArea(a.common_m, b.common_m) >= kSharedPart * smaller;
}

/// One stack per track, its views thinned: for the robot that follows it, a track is one object.
std::vector<HullStack> hullStacksOf(const std::vector<Candidate>& candidates) {
  std::vector<HullStack> stacks;
  for (const Candidate& candidate : candidates) {
    HullStack stack;
    stack.kind = candidate.kind;
    const std::size_t n = std::min(candidate.views.size(), kMaxHulls);
    for (std::size_t i = 0; i < n; ++i) {
      const ObjectView& view = candidate.views[i * candidate.views.size() / n];
      Polygon hull = hullOf(view);
      if (hull.size() < 3) continue;
      const Polygon common = stack.hulls.empty() ? hull : shared(stack.common_m, hull);
      if (!common.empty()) stack.common_m = common;
      stack.hulls.push_back({&view, std::move(hull)});
    }
    if (!stack.hulls.empty()) stacks.push_back(std::move(stack));
  }
  return stacks;
}

void joinOverlapping(std::vector<HullStack>& stacks) {
  for (bool changed = true; changed;) {
    changed = false;
    for (std::size_t i = 0; i < stacks.size() && !changed; ++i) {
      for (std::size_t k = i + 1; k < stacks.size() && !changed; ++k) {
        if (!overlaps(stacks[i], stacks[k])) continue;
        stacks[i].hulls.insert(stacks[i].hulls.end(), stacks[k].hulls.begin(), stacks[k].hulls.end());
        stacks[i].kind = std::max(stacks[i].kind, stacks[k].kind);
        stacks[i].common_m = shared(stacks[i].common_m, stacks[k].common_m);
        stacks.erase(stacks.begin() + static_cast<std::ptrdiff_t>(k));
        changed = true;
      }
    }
  }
}

}  // namespace

Polygon hullOf(const ObjectView& view) {
  const auto& b = view.prism.supports.b_m;
  const auto& sigma = view.prism.supports.sigma_m;
  if (std::none_of(sigma.begin(), sigma.end(), [](float s) { return s > 0.0f; })) return {};
  const Pose2& map_from_base = view.prism.map_from_base;
  const Eigen::Vector2d foot = map_from_base * view.prism.foot_m;
  std::vector<outline::HalfPlane> planes;
  for (std::size_t k = 0; k < b.size(); ++k) {
    const double phi =
        map_from_base.theta_rad + 2.0 * M_PI * static_cast<double>(k) / static_cast<double>(b.size());
    const Eigen::Vector2d n(std::cos(phi), std::sin(phi));
    if (std::isfinite(b[k])) planes.push_back({n, static_cast<double>(b[k]) + n.dot(foot)});
  }
  constexpr double kOpen_m = 100.0;
  Polygon hull = outline::intersectHalfPlanes(planes, kOpen_m);
  const bool open = std::any_of(hull.begin(), hull.end(), [](const Eigen::Vector2d& p) {
    return p.cwiseAbs().maxCoeff() > 0.999 * kOpen_m;
  });
  return open ? Polygon{} : hull;
}

std::vector<Group> overlayHulls(const std::vector<Candidate>& candidates, const MergerOptions& options) {
  std::vector<HullStack> stacks = hullStacksOf(candidates);
  joinOverlapping(stacks);
  std::vector<Group> groups;
  for (HullStack& stack : stacks) {
    Group group;
    group.kind = stack.kind;
    group.fit.footprint_m = overlaid(stack.hulls, options.hull_share);
    std::sort(stack.hulls.begin(), stack.hulls.end(), isPlacedEarlier);
    for (const PlacedHull& hull : stack.hulls) group.views.push_back(hull.view);
    group.fit.valid = group.fit.footprint_m.size() >= 3;
    group.fit.covariance.setZero();
    if (group.fit.valid) group.centre_m = group.fit.centre_m = centroid(group.fit.footprint_m);
    groups.push_back(std::move(group));
  }
  std::sort(groups.begin(), groups.end(), [](const Group& a, const Group& b) {
    return isPlacedEarlier({a.views.front(), {}}, {b.views.front(), {}});
  });
  return groups;
}

}  // namespace omnifleet::global_merger
