#pragma once

#include <map>
#include <string>
#include <vector>

#include "global_merger/merger.h"
#include "occupancy/contribution_store.h"
#include "outline/prism.h"

namespace omnifleet::global_merger {

/// One silhouette of something that may be an obstacle.
struct ObjectView {
  std::string robot;
  TimeNs time_ns = 0;
  std::uint32_t track_id = 0;
  Eigen::Vector2d position_m = Eigen::Vector2d::Zero();  ///< map, as the classifier put it
  outline::PrismView prism;
  bool is_flawed = false;  ///< merged of several or cut off: shapes nothing while there are others
  bool is_cut = false;     ///< by the edge of the view or by what stands before it: its top is not seen
  outline::HeightPrior height;
};

/// All views of one track of one robot, in order of time.
struct Candidate {
  std::string robot;
  std::uint32_t track_id = 0;
  ObjectKind kind = ObjectKind::kUnknown;  ///< the latest decided one
  std::vector<ObjectView> views;
};

/// Views from the store in order of (robot, track, time), without those of the fleet's robots: by sighting,
/// or because a robot of the fleet stood there at that time and its body fits the silhouette. Views whose
/// contact lies beyond `max_contact_m` are left out. Tracks of more than kMaxViews views are thinned evenly.
/// `meanwhile` is called between the fits; what it adds to the store is for the next time.
std::vector<Candidate> candidatesOf(const occupancy::ContributionStore& store, const MergerOptions& options,
                                    const std::map<std::string, RobotBody>& bodies,
                                    const Meanwhile& meanwhile = {});
inline constexpr std::size_t kMaxViews = 128;

/// The body as the prism fit wants it.
outline::KnownBody knownBody(const RobotBody& body);

}  // namespace omnifleet::global_merger
