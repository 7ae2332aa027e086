#pragma once

#include <vector>

#include "global_merger/candidates.h"
#include "outline/prism.h"

namespace omnifleet::global_merger {

/// Views, of one robot or of several, that show one thing in one place.
struct Group {
  std::vector<const ObjectView*> views;  ///< in order of (time, robot, track)
  outline::PrismFit fit;
  ObjectKind kind = ObjectKind::kUnknown;  ///< obstacle as soon as one of its tracks is called so
  bool is_top = false;                     ///< its sides look like the floor: the views show the top alone
  Eigen::Vector2d centre_m = Eigen::Vector2d::Zero();
};

/// Puts views together: each track is cut in time where its views stop showing one body in one place (it was
/// moved); the pieces of all robots are joined, surest first, where their centres are within the gate or
/// their footprints overlap and one prism explains both. Fitted over all views; of two that then stand in one
/// place, never seen in one frame, the one with more views stays. What was moved has a group in each place:
/// whether the floor was seen where it stood is the merger's to ask. The candidates must outlive the groups.
/// `meanwhile` is called before each fit.
std::vector<Group> groupViews(const std::vector<Candidate>& candidates, const MergerOptions& options,
                              const Meanwhile& meanwhile = {});

/// Tops alone (docs/methods.md), of things whose sides look like the floor: of each track what no whole thing
/// explains, nor one body, is tried as the top of something; those of all robots are joined as in
/// groupViews(). Where a whole thing stands there is none. The candidates must outlive the groups.
std::vector<Group> groupTops(const std::vector<Candidate>& candidates, const std::vector<Group>& whole,
                             const MergerOptions& options, const Meanwhile& meanwhile = {});

}  // namespace omnifleet::global_merger
