#pragma once

// IDL types ↔ domain types, one pair of functions per topic. Filling functions reuse the target's buffers.
// `fromWire` returns false where a sample must not be believed (a non-finite number, an unknown enumerator);
// such a sample is counted by the caller and never passed on as valid; what it leaves behind is an invalid
// one of the same robot and time, which keeps the place in the line.

#include <string>

#include "dataset/dataset.h"

#include "idl/formation.h"
#include "idl/laser.h"
#include "idl/local_map.h"
#include "idl/localizer.h"
#include "idl/map.h"
#include "idl/objects.h"
#include "idl/wheels.h"
#include "motion/formation_types.h"
#include "observation/observation.h"
#include "occupancy/contribution.h"

namespace omnifleet::adapters {

/// Which clock the acquisition times of this run are on.
enum class RunClock { kSystem, kDataset, kSim };

/// Fills a header; `published_ns` is taken from the system clock and serves diagnostics only.
void fillHeader(TimeNs acquired_ns, std::uint32_t sequence, RunClock clock, v1::Header& header);

void toWire(const LocalMap& from, RunClock clock, v1::LocalMap& to);
bool fromWire(const v1::LocalMap& from, LocalMap& to);

void toWire(const Objects& from, RunClock clock, v1::Objects& to);
bool fromWire(const v1::Objects& from, Objects& to);

/// Also refused: speeds beyond dataset::kMaxWheelSpeedMps, which no robot of this kind has.
bool fromWire(const v1::WheelOdometry& from, dataset::WheelRow& to);

/// `range_max_m` as in the scanner's sensor.yaml.
void toWire(const dataset::LaserRow& from, const std::string& robot, std::uint32_t sequence, double range_max_m,
            RunClock clock, v1::LaserScan& to);
/// Also refused: what dataset::problemOf finds in a single scan; no ranges are left of it.
bool fromWire(const v1::LaserScan& from, dataset::LaserRow& to);

void toWire(const PoseEstimate& from, RunClock clock, std::uint32_t term, v1::Pose& to);
bool fromWire(const v1::Pose& from, PoseEstimate& to);

void toWire(const motion::FormationCommand& from, RunClock clock, v1::FormationCommand& to);
bool fromWire(const v1::FormationCommand& from, motion::FormationCommand& to);

void toWire(const motion::FormationState& from, RunClock clock, v1::FormationState& to);
bool fromWire(const v1::FormationState& from, motion::FormationState& to);

/// One front end's sample: every measurement of one time (maybe none).
void toWire(const std::string& source, TimeNs acquired_ns, std::uint32_t sequence, FrameState state,
            const std::vector<Measurement>& from, RunClock clock, v1::Measurement& to);
bool fromWire(const v1::Measurement& from, std::vector<Measurement>& to);

void toWire(const occupancy::Contribution& from, RunClock clock, v1::Contribution& to);
bool fromWire(const v1::Contribution& from, occupancy::Contribution& to);

void toWire(const occupancy::KeyframePose& from, RunClock clock, v1::KeyframePose& to);
bool fromWire(const v1::KeyframePose& from, occupancy::KeyframePose& to);

}  // namespace omnifleet::adapters
