#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "global_merger/merger.h"
#include "observation/error_code.h"

// What the global merger reports about the map. Places are in map, metres.
namespace omnifleet::global_merger {

Message contributionRejected(const std::string& robot);
/// @param files names of the files @param reason of the first
Message mapNotSaved(const std::string& files, const std::string& reason);
Message mapEmpty();
/// The map is empty, and no valid frame of this robot arrived. @param frames the invalid ones
Message noUsableFrame(const std::string& robot, std::uint64_t frames);
/// Trajectories begin where this incarnation of the merger began.
Message trajectoryIncomplete();
/// Candidates that are not in the map for one reason.
Message candidatesRejected(Reason reason, const std::vector<Eigen::Vector2d>& at_m);
/// Mapped, but the floor was seen there as well.
Message outlinesLowContrast(const std::vector<Eigen::Vector2d>& at_m);
/// Mapped from views that disagree.
Message outlinesDisagree(const std::vector<Eigen::Vector2d>& at_m);
/// Mapped as thin slivers.
Message outlinesThin(const std::vector<Eigen::Vector2d>& at_m);
/// Occupied cells without an outline.
Message cellsWithoutOutline(const std::vector<Eigen::Vector2d>& at_m);

/// Counts of the messages above.
struct MapWarningCounts {
  std::size_t rejected = 0, thin = 0, without_outline = 0, low_contrast = 0, disagreeing = 0;
  std::size_t total() const { return rejected + thin + without_outline + low_contrast + disagreeing; }
};
/// The summary that stays in the status.
Message mapIncomplete(const MapWarningCounts& counts);

}  // namespace omnifleet::global_merger
