#include "estimation/sources.h"

#include "estimation/fleet_state.h"
#include "estimation/troubles.h"

namespace omnifleet::estimation {
namespace {

SourceSet joined(const SourceSet& a, const SourceSet& b) {
  return {static_cast<std::uint16_t>(a.bits | b.bits)};
}

/// Motion since the frame before.
void addOdometry(const FleetState& fleet, const RobotNode& robot, const Step& step, PoseSources& sources) {
  if (step.wheels && (step.wheels_rejected || (step.rejected && !step.by_floor)))
    sources.rejected.add(Source::kWheels);
  if (step.rejected && step.by_floor) sources.rejected.add(Source::kFloor);
  if (step.motion == kNoFactor || step.rejected) return;
  if (step.by_floor) sources.used.add(Source::kFloor);
  if (step.by_appearance) sources.used.add(Source::kAppearance);
  if (!step.wheels || step.wheels_rejected) return;
  sources.used.add(Source::kWheels);
  if (step.floor && robot.floor.isConfirmed()) sources.used.add(Source::kFloor);
  if (step.compass && fleet.options.appearance.with_wheels) sources.used.add(Source::kAppearance);
}

}  // namespace

PoseSources sourcesOf(const FleetState& fleet, const RobotFrame& frame) {
  const RobotNode& robot = *frame.robot;
  PoseSources sources;
  if (!frame.fresh) return sources;
  sources.used = robot.absolute_aid.used;
  sources.rejected = joined(frame.rejected, robot.absolute_aid.rejected);
  if (robot.scan_aid.contradicted) sources.rejected.add(Source::kScan);
  if (robot.start.contradicted) sources.rejected.add(Source::kInitialPose);
  if (!robot.located()) return {{}, sources.rejected};
  const Step& step = robot.window.back();
  addOdometry(fleet, robot, step, sources);
  if (step.scan.factor != kNoFactor || step.by_search) sources.used.add(Source::kScan);
  for (const ViewLink& link : step.views)
    sources.used.add(link.landmark != 0 ? Source::kLandmarks : Source::kSightings);
  if (robot.start.given && step.pose == robot.start.pose) sources.used.add(Source::kInitialPose);
  return sources;
}

}  // namespace omnifleet::estimation
