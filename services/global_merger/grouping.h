#pragma once

#include <vector>

#include "global_merger/candidates.h"
#include "outline/prism.h"

namespace omnifleet::global_merger {

/// Views, of one robot or several, that show one object at one place.
struct Group {
  std::vector<const ObjectView*> views;  ///< in order of (time, robot, track)
  outline::PrismFit fit;
  ObjectKind kind = ObjectKind::kUnknown;  ///< obstacle if any of its tracks is an obstacle
  bool is_top_face = false;  ///< its sides look like the floor: the views show only the top face
  Eigen::Vector2d centre_m = Eigen::Vector2d::Zero();
};

/// Groups views. Each track is split in time where its views stop showing one body at one place (it was
/// moved). The pieces of all robots are joined, most certain first, if their centres are within the gate or
/// their footprints overlap, and one prism explains both. Groups are then fitted over all views. Of two
/// groups that overlap, the one with more views is kept. An object that was moved has a group at each place;
/// the merger checks whether the floor was seen at the old place. The candidates must outlive the groups.
/// `meanwhile` is called before each fit.
std::vector<Group> groupViews(const std::vector<Candidate>& candidates, const MergerOptions& options,
                              const Meanwhile& meanwhile = {});

/// Groups of which only the top face is segmented (docs/methods/global_merger.md), because the sides look
/// like the floor. The views of each track that no whole object and no single body explains are tried as a
/// top face. Those of all robots are joined as in groupViews(). None is kept where a whole object is. The
/// candidates must outlive the groups.
std::vector<Group> groupTopFaces(const std::vector<Candidate>& candidates, const std::vector<Group>& whole,
                                 const MergerOptions& options, const Meanwhile& meanwhile = {});

}  // namespace omnifleet::global_merger
