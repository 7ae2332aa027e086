#include "global_merger/grouping.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <set>
#include <tuple>

#include "outline/half_planes.h"

namespace omnifleet::global_merger {
namespace {

using Views = std::vector<const ObjectView*>;

bool isEarlier(const ObjectView* a, const ObjectView* b) {
  return std::tie(a->time_ns, a->robot, a->track_id) < std::tie(b->time_ns, b->robot, b->track_id);
}

/// The classifier's height counts once per track: the latest estimate.
outline::HeightPrior heightPrior(const Views& views) {
  std::map<std::pair<std::string, std::uint32_t>, outline::HeightPrior> latest;
  for (const auto* view : views) {
    if (view->height.sigma_m > 0) latest[{view->robot, view->track_id}] = view->height;
  }
  double weight = 0.0, sum = 0.0;
  for (const auto& [track, height] : latest) {
    const double w = 1.0 / (height.sigma_m * height.sigma_m);
    weight += w;
    sum += w * height.height_m;
  }
  return weight > 0 ? outline::HeightPrior{sum / weight, 1.0 / std::sqrt(weight)} : outline::HeightPrior{};
}

/// Its top is visible in hardly any view: an object as high as the camera or higher. Share of cut views: 0.91
/// and more; for lower objects in clutter up to 0.57.
bool isTall(const Views& views) {
  constexpr std::size_t kLeast =
      30;  // with fewer views the share means little: pieces of tape are cut as often
  constexpr double kShare = 0.8;
  const auto cut = std::count_if(views.begin(), views.end(), [](const auto* view) { return view->is_cut; });
  return views.size() >= kLeast && static_cast<double>(cut) > kShare * static_cast<double>(views.size());
}

/// Fits only the side that faces each camera.
outline::PrismFit fitContact(const Views& views, const outline::PrismOptions& options) {
  std::vector<outline::PrismView> facing;
  for (const auto* view : views) {
    if (!view->is_cut) continue;  // shows a piece of it
    facing.push_back(view->prism);
    SupportFunction& supports = facing.back().supports;
    for (std::size_t k = 0; k < supports.size(); ++k) {
      if (supports.b_m[k] > 0.0F) supports.sigma_m[k] = 0.0F;
    }
  }
  return outline::fitPrism(facing, options, {});
}

/// Flawed views are used only if there are no others.
outline::PrismFit fitViews(const Views& views, const outline::PrismOptions& options) {
  if (isTall(views)) return fitContact(views, options);
  std::vector<outline::PrismView> good, flawed;
  for (const auto* view : views) (view->is_flawed ? flawed : good).push_back(view->prism);
  return outline::fitPrism(good.empty() ? flawed : good, options, heightPrior(views));
}

/// Fewer views and iterations, to test only whether views belong together.
outline::PrismOptions quick(const MergerOptions& options) {
  outline::PrismOptions quick = options.prism;
  quick.max_views = std::min(quick.max_views, 12);
  quick.iterations = std::min(quick.iterations, 6);
  quick.vertex_penalty = 0.0;
  return quick;
}

constexpr std::size_t kLeastTrackTopViews =
    8;                                      // views of one track that are required to recognize a top face
constexpr std::size_t kLeastTopViews = 12;  // views in total: fewer may agree on a top face by chance

/// Views of an object whose sides look like the floor are rarely clean: flawed views count, with a larger σ.
outline::PrismView asTopFace(const ObjectView& view) {
  constexpr float kFlawed = 3.0F;  // factor of σ
  outline::PrismView top = view.prism;
  top.top_face_only = true;
  if (!view.is_flawed) return top;
  for (float& sigma_m : top.supports.sigma_m) sigma_m *= kFlawed;
  return top;
}

outline::PrismFit fitTopFace(const Views& views, const outline::PrismOptions& options) {
  std::vector<outline::PrismView> tops;
  for (const auto* view : views) tops.push_back(asTopFace(*view));
  return outline::fitPrism(tops, options);
}

/// All fits go through this function.
Group groupOf(Views views, ObjectKind kind, const outline::PrismOptions& options, const Meanwhile& meanwhile,
              bool is_top_face = false) {
  if (meanwhile) meanwhile();
  Group group;
  group.kind = kind;
  group.is_top_face = is_top_face;
  group.fit = is_top_face ? fitTopFace(views, options) : fitViews(views, options);
  group.views = std::move(views);
  if (group.fit.valid) {
    group.centre_m = group.fit.centre_m;
  } else {
    for (const auto* view : group.views)
      group.centre_m += view->position_m / static_cast<double>(group.views.size());
  }
  return group;
}

bool isOneBody(const Group& group, const MergerOptions& options) {
  return group.fit.valid && group.fit.spread <= options.max_spread;
}

double sigmaOf(const Group& group) {
  return group.fit.valid ? std::sqrt(0.5 * group.fit.covariance.trace()) : 1.0;
}

bool isObject(const Group& group, const MergerOptions& options) {
  return isOneBody(group, options) && static_cast<int>(group.views.size()) >= options.min_views &&
         sigmaOf(group) <= options.max_sigma_m;
}

/// Halves the views in time until each piece shows one body at one place.
void halve(Group whole, const MergerOptions& options, const Meanwhile& meanwhile,
           std::vector<Group>& pieces) {
  if (whole.views.size() < 2 || whole.fit.spread <= options.max_spread) {
    pieces.push_back(std::move(whole));
    return;
  }
  const auto middle = whole.views.begin() + static_cast<std::ptrdiff_t>(whole.views.size() / 2);
  halve(groupOf({whole.views.begin(), middle}, whole.kind, quick(options), meanwhile), options, meanwhile,
        pieces);
  halve(groupOf({middle, whole.views.end()}, whole.kind, quick(options), meanwhile), options, meanwhile,
        pieces);
}

/// Splits a track into its places. A track without a valid outline stays whole if most of its views belong to
/// pieces that are no objects either: its views do not agree, and that is reported.
void cut(const Views& views, ObjectKind kind, const MergerOptions& options, const Meanwhile& meanwhile,
         std::vector<Group>& places) {
  Group whole = groupOf(views, kind, quick(options), meanwhile);
  std::vector<Group> pieces;
  halve(whole, options, meanwhile, pieces);
  std::size_t shown = 0;
  for (const Group& piece : pieces) shown += isObject(piece, options) ? piece.views.size() : 0;
  if (!whole.fit.valid && 2 * shown < views.size()) {
    places.push_back(std::move(whole));
  } else {
    std::move(pieces.begin(), pieces.end(), std::back_inserter(places));
  }
}

/// A part of an object that a nearer one splits in two for a laser.
bool maybePart(const ObjectView& view) {
  return view.is_flawed && view.prism.camera_height_m <= 0.0;
}

/// Two views of one robot at one time show two objects, unless they may be parts of one.
bool shareAFrame(const Group& a, const Group& b) {
  std::set<std::pair<std::string, TimeNs>> frames;
  for (const auto* view : a.views) {
    if (!maybePart(*view)) frames.emplace(view->robot, view->time_ns);
  }
  return std::any_of(b.views.begin(), b.views.end(), [&](const ObjectView* view) {
    return !maybePart(*view) && frames.count({view->robot, view->time_ns}) > 0;
  });
}

/// Overlap as a share of the smaller footprint.
double overlap(const Group& a, const Group& b) {
  if (!a.fit.valid || !b.fit.valid) return 0.0;
  const double smaller = std::min(signedArea(a.fit.footprint_m), signedArea(b.fit.footprint_m));
  return outline::convexIntersectionArea(a.fit.footprint_m, b.fit.footprint_m) / smaller;
}

bool areNear(const Group& a, const Group& b, const MergerOptions& options) {
  const double reach = options.gate_m + std::min(2.0 * (sigmaOf(a) + sigmaOf(b)), 0.3);
  if ((a.centre_m - b.centre_m).norm() <= reach) return true;
  return overlap(a, b) > 0.3;
}

Group joined(const Group& a, const Group& b, const outline::PrismOptions& options,
             const Meanwhile& meanwhile) {
  Views views = a.views;
  views.insert(views.end(), b.views.begin(), b.views.end());
  std::sort(views.begin(), views.end(), isEarlier);
  return groupOf(std::move(views), std::max(a.kind, b.kind), options, meanwhile,  // obstacle over unknown
                 a.is_top_face && b.is_top_face);
}

/// Joins the piece to the nearest group with which it forms one body. Returns false if there is none.
bool join(const Group& piece, const MergerOptions& options, const Meanwhile& meanwhile,
          std::vector<Group>& groups) {
  std::vector<std::pair<double, std::size_t>> near;
  for (std::size_t i = 0; i < groups.size(); ++i) {
    if (areNear(piece, groups[i], options))
      near.emplace_back((piece.centre_m - groups[i].centre_m).norm(), i);
  }
  std::sort(near.begin(), near.end());
  for (const auto& [distance, i] : near) {
    if (shareAFrame(piece, groups[i])) continue;
    Group both = joined(groups[i], piece, quick(options), meanwhile);
    // Seen by lasers from one side: an outline that stays open may be a plain shape.
    if (!both.fit.valid && both.views.front()->prism.camera_height_m <= 0.0)
      both = joined(groups[i], piece, options.prism, meanwhile);
    if (!isOneBody(both, options)) continue;
    groups[i] = std::move(both);
    return true;
  }
  return false;
}

/// Fits a group over all its views, then again without the views that show something else.
Group refined(const Group& group, const MergerOptions& options, const Meanwhile& meanwhile) {
  Group all = groupOf(group.views, group.kind, options.prism, meanwhile, group.is_top_face);
  if (!all.fit.valid) return all;
  Views kept;
  for (const auto* view : all.views) {
    const outline::PrismView alone = all.is_top_face ? asTopFace(*view) : view->prism;
    const auto expected = outline::prismSupports(all.fit.footprint_m, all.fit.height_m, alone, 0.0,
                                                 static_cast<int>(alone.supports.size()));
    double sum = 0.0, count = 0.0;
    for (std::size_t k = 0; k < expected.size(); ++k) {
      const double sigma = alone.supports.sigma_m[k], pose = options.prism.pose_sigma_m;
      if (!(sigma > 0)) continue;
      const double off = expected.b_m[k] - alone.supports.b_m[k];
      sum += off * off / (sigma * sigma + pose * pose);
      count += 1.0;
    }
    if (count > 0 && sum <= count * options.max_spread * options.max_spread) kept.push_back(view);
  }
  if (kept.empty() || kept.size() == all.views.size()) return all;
  return groupOf(std::move(kept), group.kind, options.prism, meanwhile, group.is_top_face);
}

/// Two bodies cannot be at one place. Groups that the quick fits kept apart are joined if the full fit
/// explains all views; otherwise the one with fewer views is dropped.
void resolveOverlaps(const MergerOptions& options, const Meanwhile& meanwhile, std::vector<Group>& groups) {
  constexpr double kShared = 0.4;
  std::stable_sort(groups.begin(), groups.end(),
                   [](const Group& a, const Group& b) { return a.views.size() > b.views.size(); });
  std::vector<Group> kept;
  for (Group& group : groups) {
    const auto other = std::find_if(kept.begin(), kept.end(),
                                    [&](const Group& known) { return overlap(known, group) > kShared; });
    if (other == kept.end()) {
      kept.push_back(std::move(group));
      continue;
    }
    if (shareAFrame(*other, group)) continue;
    Group both = joined(*other, group, options.prism, meanwhile);
    if (isOneBody(both, options)) *other = std::move(both);
  }
  groups = std::move(kept);
}

/// Surely above the floor.
bool isTopFace(const Group& top, const MergerOptions& options) {
  constexpr double kLeast_m = 0.05, kSigmas = 3.0;
  return isObject(top, options) && top.fit.height_sigma_m > 0 &&
         top.fit.height_m - kSigmas * top.fit.height_sigma_m > kLeast_m;
}

/// Its views agree as a top face, but not as a whole object.
bool fitsBetterAsTopFace(const Group& top, const Group& whole) {
  constexpr double kShare = 0.3;  // of the spread as a whole object, that may be left
  return !whole.fit.valid || top.fit.spread < kShare * whole.fit.spread;
}

}  // namespace

std::vector<Group> groupTopFaces(const std::vector<Candidate>& candidates, const std::vector<Group>& whole,
                                 const MergerOptions& options, const Meanwhile& meanwhile) {
  std::set<const ObjectView*> explained;
  for (const Group& group : whole) explained.insert(group.views.begin(), group.views.end());
  std::vector<Group> pieces, tops;
  for (const Candidate& candidate : candidates) {
    Views left;
    for (const ObjectView& view : candidate.views)
      if (explained.count(&view) == 0) left.push_back(&view);
    if (left.size() < kLeastTrackTopViews || 2 * left.size() < candidate.views.size()) continue;
    const Group as_whole = groupOf(left, candidate.kind, quick(options), meanwhile);
    if (isOneBody(as_whole, options)) continue;
    Group top = groupOf(left, candidate.kind, quick(options), meanwhile, true);
    if (isTopFace(top, options) && fitsBetterAsTopFace(top, as_whole)) pieces.push_back(std::move(top));
  }
  std::stable_sort(pieces.begin(), pieces.end(),
                   [](const Group& a, const Group& b) { return sigmaOf(a) < sigmaOf(b); });
  for (Group& piece : pieces)
    if (!join(piece, options, meanwhile, tops)) tops.push_back(std::move(piece));
  std::stable_sort(tops.begin(), tops.end(),
                   [](const Group& a, const Group& b) { return a.views.size() > b.views.size(); });
  std::vector<Group> kept;
  const auto isTaken = [&](const std::vector<Group>& by, const Group& top) {
    constexpr double kShared = 0.1;
    return std::any_of(by.begin(), by.end(),
                       [&](const Group& group) { return overlap(group, top) > kShared; });
  };
  for (Group& top : tops) {
    Group sharper = refined(top, options, meanwhile);
    if (sharper.views.size() >= kLeastTrackTopViews && isObject(sharper, options)) top = std::move(sharper);
    if (top.views.size() >= kLeastTopViews && isTopFace(top, options) && !isTaken(whole, top) &&
        !isTaken(kept, top))
      kept.push_back(std::move(top));
  }
  return kept;
}

std::vector<Group> groupViews(const std::vector<Candidate>& candidates, const MergerOptions& options,
                              const Meanwhile& meanwhile) {
  std::vector<Group> pieces, groups;
  for (const auto& candidate : candidates) {
    Views views;
    for (const auto& view : candidate.views) views.push_back(&view);
    cut(views, candidate.kind, options, meanwhile, pieces);
  }
  std::stable_sort(pieces.begin(), pieces.end(),
                   [](const Group& a, const Group& b) { return sigmaOf(a) < sigmaOf(b); });
  for (auto& piece : pieces) {
    if (!join(piece, options, meanwhile, groups)) groups.push_back(std::move(piece));
  }
  for (auto& group : groups) group = refined(group, options, meanwhile);
  resolveOverlaps(options, meanwhile, groups);
  std::sort(groups.begin(), groups.end(),
            [](const Group& a, const Group& b) { return isEarlier(a.views.front(), b.views.front()); });
  return groups;
}

}  // namespace omnifleet::global_merger
