#pragma once

#include <map>
#include <string>
#include <vector>

#include "global_merger/merger.h"
#include "occupancy/contribution_store.h"
#include "outline/prism.h"

namespace omnifleet::global_merger {

/// One silhouette of a possible obstacle.
struct ObjectView {
  std::string robot;
  TimeNs time_ns = 0;
  std::uint32_t track_id = 0;
  Eigen::Vector2d position_m = Eigen::Vector2d::Zero();  ///< map, from the classifier
  outline::PrismView prism;
  bool is_flawed = false;  ///< merged from several objects or cut: used only if there are no other views
  bool is_cut = false;     ///< by the edge of the view or by a nearer object: its top is not visible
  outline::HeightPrior height;
};

/// All views of one track of one robot, in order of time.
struct Candidate {
  std::string robot;
  std::uint32_t track_id = 0;
  ObjectKind kind = ObjectKind::kUnknown;  ///< the latest decided kind
  std::vector<ObjectView> views;
};

/// Views from the store, ordered by (robot, track, time), without views of the fleet's robots. These are
/// recognized by sighting, or because a robot of the fleet was there at that time and its body fits the
/// silhouette. Views whose contact is farther than `max_contact_m` are left out. Tracks with more than
/// kMaxViews views are thinned evenly. `meanwhile` is called between the fits; what it adds to the store is
/// used by the next call.
std::vector<Candidate> candidatesOf(const occupancy::ContributionStore& store, const MergerOptions& options,
                                    const std::map<std::string, RobotBody>& bodies,
                                    const Meanwhile& meanwhile = {});
inline constexpr std::size_t kMaxViews = 128;

/// The body in the form that the prism fit requires.
outline::KnownBody knownBody(const RobotBody& body);

}  // namespace omnifleet::global_merger
