#include "global_merger/warning_report.h"

#include <algorithm>
#include <iterator>

#include "global_merger/map_warnings.h"
#include "global_merger/messages.h"
#include "global_merger/verdict.h"

namespace omnifleet::services {
namespace {

/// @return number of candidates rejected for this reason
std::size_t reportRejected(const global_merger::Merger& map, global_merger::Reason reason,
                           bus::StatusBoard& status) {
  std::vector<Eigen::Vector2d> at_m;
  for (const global_merger::RejectedCandidate& candidate : map.rejected())
    if (candidate.reason == reason) at_m.push_back(candidate.at_m);
  if (!at_m.empty()) status.report(global_merger::candidatesRejected(reason, at_m));
  return at_m.size();
}

}  // namespace

void reportMapWarnings(const global_merger::Merger& map, bus::StatusBoard& status) {
  namespace gm = global_merger;
  gm::MapWarningCounts counts;
  for (const auto reason :
       {gm::Reason::kNoShape, gm::Reason::kUncertainPlace, gm::Reason::kPiece, gm::Reason::kRough,
        gm::Reason::kFloorSeen, gm::Reason::kFlat, gm::Reason::kPattern, gm::Reason::kHidden,
        gm::Reason::kTopFaceOnly, gm::Reason::kPossibleMirror})
    counts.rejected += reportRejected(map, reason, status);
  const std::vector<dataset::MapObject>& objects = map.lastOutlines();
  const auto flagged = [&](gm::Quality quality) {
    std::vector<Eigen::Vector2d> at_m;
    for (const dataset::MapObject& object : objects)
      for (const std::string& flag : object.quality)
        if (flag == gm::toString(quality)) at_m.push_back(object.centroid_m);
    return at_m;
  };
  const auto report = [&status](const std::vector<Eigen::Vector2d>& at_m, auto message) {
    if (!at_m.empty()) status.report(message(at_m));
    return at_m.size();
  };
  counts.low_contrast = report(flagged(gm::Quality::kLowContrast), gm::outlinesLowContrast);
  counts.disagreeing = report(flagged(gm::Quality::kDisagreeing), gm::outlinesDisagree);
  counts.thin = report(flagged(gm::Quality::kThin), gm::outlinesThin);
  std::vector<dataset::MapObject> closed;  // small structure is as uncertain as cells without any outline
  std::copy_if(objects.begin(), objects.end(), std::back_inserter(closed),
               [](const dataset::MapObject& object) { return !object.isOpen(); });
  counts.without_outline =
      report(gm::occupiedWithoutOutline(map.map().grid(objects), closed), gm::cellsWithoutOutline);
  // The status shows only the last message, so the summary comes last.
  if (counts.total() > 0) status.report(gm::mapIncomplete(counts));
}

}  // namespace omnifleet::services
