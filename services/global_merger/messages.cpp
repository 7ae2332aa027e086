#include "global_merger/messages.h"

#include "global_merger/verdict.h"

#include <fmt/format.h>

#include <algorithm>

namespace omnifleet::global_merger {
namespace {

std::string places(const std::vector<Eigen::Vector2d>& at_m) {
  constexpr std::size_t kListed = 12;
  std::string text;
  for (std::size_t i = 0; i < std::min(at_m.size(), kListed); ++i)
    text += fmt::format("{}({:.2f}, {:.2f})", i > 0 ? ", " : "", at_m[i].x(), at_m[i].y());
  if (at_m.size() > kListed) text += fmt::format(" and {} more", at_m.size() - kListed);
  return text + " m";
}

const char* reasonOf(Reason reason) {
  switch (reason) {
    case Reason::kNoShape:
      return "their views do not agree on a shape";
    case Reason::kUncertainPlace:
      return "their place is too uncertain";
    case Reason::kPiece:
      return "they were very rarely seen, and always cut";
    case Reason::kHidden:
      return "they were rarely seen, and always above something nearer";
    case Reason::kRough:
      return "they were rarely seen, and no upright body explains the views";
    case Reason::kFloorSeen:
      return "the floor was seen at the same place (they are gone, or of the floor's colour)";
    case Reason::kFlat:
    case Reason::kPattern:
      return "they are as flat as floor markings, or low and rarely seen";
    case Reason::kTopFaceOnly:
      return "parallax gives them a height, but mostly floor was seen there (only their top face is "
             "segmented; they stand within 0.5 m)";
    case Reason::kPossibleMirror:
      return "they are gaps in a wall that can be doors or mirrors; the map behind them stays unknown until "
             "a robot "
             "drives through";
    default:
      return toString(reason);
  }
}

}  // namespace

Message contributionRejected(const std::string& robot) {
  return {ErrorCode::kContributionRejected,
          robot + ": map contribution rejected, its content is inconsistent; check the publisher's version"};
}

Message mapNotSaved(const std::string& files, const std::string& reason) {
  return {ErrorCode::kFileWriteFailed, "map not saved completely, missing: " + files + " (" + reason +
                                           "); earlier files stay as they were"};
}

Message mapEmpty() {
  return {ErrorCode::kMapEmpty,
          "no robot contributed to the map, so no map is saved; see the localizer's log"};
}

Message noUsableFrame(const std::string& robot, std::uint64_t frames) {
  return {ErrorCode::kMapEmpty,
          fmt::format("no usable frame of {} has arrived ({} invalid) and no other robot contributed to the "
                      "map, so no map is saved; see the logs of its camera and its local mapper",
                      robot, frames)};
}

Message trajectoryIncomplete() {
  return {
      ErrorCode::kTrajectoryIncomplete,
      "this merger was restarted: trajectories/, covariances/ and localization/ begin at the restart, and "
      "contributions of its own robot from before may be missing in the map"};
}

Message candidatesRejected(Reason reason, const std::vector<Eigen::Vector2d>& at_m) {
  return {ErrorCode::kCandidatesRejected,
          fmt::format("candidates not in the map, because {}: {}", reasonOf(reason), places(at_m))};
}

Message outlinesLowContrast(const std::vector<Eigen::Vector2d>& at_m) {
  return {ErrorCode::kOutlinesUncertain,
          "mapped, but hardly distinguishable from the floor, which was seen there as well; the outline may "
          "be off: " +
              places(at_m)};
}

Message outlinesDisagree(const std::vector<Eigen::Vector2d>& at_m) {
  return {ErrorCode::kOutlinesUncertain,
          "mapped from views that disagree or hardly ever show the obstacle alone; place and outline may be "
          "off: " +
              places(at_m)};
}

Message outlinesThin(const std::vector<Eigen::Vector2d>& at_m) {
  return {ErrorCode::kOutlinesUncertain,
          "mapped as thin slivers: boards, or dark sides of obstacles of which the rest has the floor's "
          "colour: " +
              places(at_m)};
}

Message cellsWithoutOutline(const std::vector<Eigen::Vector2d>& at_m) {
  return {ErrorCode::kOutlinesUncertain,
          "occupied cells without an outline (rarely seen, or merged with a neighbour): " + places(at_m)};
}

Message mapIncomplete(const MapWarningCounts& counts) {
  std::string parts;
  const auto add = [&](std::size_t count, const char* what) {
    if (count > 0) parts += fmt::format("{}{} {}", parts.empty() ? "" : ", ", count, what);
  };
  add(counts.rejected, "candidate(s) not mapped");
  add(counts.thin, "mapped as thin slivers");
  add(counts.without_outline, "group(s) of occupied cells without an outline");
  add(counts.low_contrast, "outline(s) of low contrast");
  add(counts.disagreeing, "outline(s) from disagreeing views");
  return {ErrorCode::kMapIncomplete, "map uncertain in places: " + parts +
                                         "; the log lists places and reasons. Look there, or drive closer"};
}

}  // namespace omnifleet::global_merger
