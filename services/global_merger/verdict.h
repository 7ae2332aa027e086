#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "global_merger/evidence.h"
#include "global_merger/merger.h"

namespace omnifleet::global_merger {

enum class Decision : std::uint8_t {
  kObstacle,      ///< in the map with its closed outline
  kStructure,     ///< it stands there, but its outline is open: part of a wall or of furniture against one
  kFloorMarking,  ///< flat: the floor continues there
  kRobot,         ///< a robot of the fleet that publishes nothing
  kUndecided,     ///< live: not enough views yet
  kRejected
};

/// Why a candidate is not in the map as an obstacle.
enum class Reason : std::uint8_t {
  kNone,            ///< it is
  kFewViews,        ///< not enough views yet
  kUndecidedKind,   ///< robot or obstacle: not known yet
  kSilentRobot,     ///< has the body of a fleet robot that has no pose in this map
  kNoShape,         ///< the views do not agree on a shape
  kUncertainPlace,  ///< the σ of its centre is too large
  kPiece,           ///< very rarely seen, and always cut: a piece of what stands there
  kRough,           ///< rarely seen, and no upright body explains the views well
  kFlat,            ///< no higher than a floor marking
  kPattern,         ///< low, and missed as often as it was seen: tiles, stains
  kFloorSeen,       ///< the floor was seen at its place: it is gone, or was never there
  kHidden,       ///< rarely seen, and always above something nearer: a piece of a wall, which moves with the
                 ///< camera
  kTopFaceOnly,  ///< mostly floor was seen there, but parallax gives it a height
  kAttached,     ///< its outline continues beyond it: it stands against a wall or other furniture
  kOpenOutline,  ///< its top was never seen, and no camera saw parts of its outline
  kPossibleMirror,  ///< it lies behind a gap in a wall that can be a mirror
};
/// Code as published: lower case with underscores.
const char* toString(Reason reason);

/// What is uncertain about a mapped outline.
enum class Quality : std::uint8_t {
  kLowContrast = 1,  ///< the floor was seen at its place as well
  kDisagreeing = 2,  ///< its views disagree, or hardly ever show it alone
  kThin = 4,         ///< a sliver: a board, or one side of something
};
const char* toString(Quality quality);

struct Verdict {
  Decision decision = Decision::kRejected;
  Reason reason = Reason::kNone;
  std::uint8_t quality = 0;  ///< of an obstacle: a set of Quality
  bool is_flat = false;      ///< no higher than a floor marking, as far as the views show
  bool to_report = false;    ///< rejected, but something may stand there
};

/// Codes of the flags of a verdict.
std::vector<std::string> qualityOf(const Verdict& verdict);

/// Decides from the evidence alone. @param is_final at the end of a run: undecided candidates are decided by
/// their fit
Verdict verdictOf(const Evidence& evidence, const MergerOptions& options, bool is_final);

}  // namespace omnifleet::global_merger
