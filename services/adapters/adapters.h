#pragma once

// Conversions between IDL types and domain types, one pair of functions per topic. They reuse the buffers of
// the target. `fromWire` returns false for an invalid sample (a non-finite number, an unknown enumerator).
// The caller counts such a sample and never passes it on as valid. The target is then an invalid sample of
// the same robot and time, which keeps the place in the stream.

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
#include "occupancy/reconciler.h"

namespace omnifleet::adapters {

/// The clock of the acquisition times of a run.
enum class RunClock { kSystem, kDataset, kSim };

/// Fills a header. `published_ns` is the system time, for diagnostics only.
void fillHeader(TimeNs acquired_ns, std::uint32_t sequence, RunClock clock, v1::Header& header);

void toWire(const LocalMap& from, RunClock clock, v1::LocalMap& to);
bool fromWire(const v1::LocalMap& from, LocalMap& to);

void toWire(const Objects& from, RunClock clock, v1::Objects& to);
bool fromWire(const v1::Objects& from, Objects& to);

/// Also rejects speeds beyond dataset::kMaxWheelSpeedMps, the limit of this kind of robot.
bool fromWire(const v1::WheelOdometry& from, dataset::WheelRow& to);

/// @param range_max_m of the scanner's sensor.yaml
void toWire(const dataset::LaserRow& from, const std::string& robot, std::uint32_t sequence,
            double range_max_m, RunClock clock, v1::LaserScan& to);
/// Also rejects a scan in which dataset::problemOf finds a problem. The target then has no ranges.
bool fromWire(const v1::LaserScan& from, dataset::LaserRow& to);

void toWire(const PoseEstimate& from, RunClock clock, std::uint32_t term, v1::Pose& to);
bool fromWire(const v1::Pose& from, PoseEstimate& to);

/// Signatures longer than the bounds of the IDL are cut; fromWire() refuses what does not fit its format.
void toWire(const Place& from, RunClock clock, v1::Place& to);
bool fromWire(const v1::Place& from, Place& to);

void toWire(const Alignment& from, RunClock clock, v1::Alignment& to);
bool fromWire(const v1::Alignment& from, Alignment& to);

void toWire(const motion::FormationCommand& from, RunClock clock, v1::FormationCommand& to);
bool fromWire(const v1::FormationCommand& from, motion::FormationCommand& to);

void toWire(const motion::FormationState& from, RunClock clock, v1::FormationState& to);
bool fromWire(const v1::FormationState& from, motion::FormationState& to);

/// One sample of a measurement front end: all measurements at one time (may be none).
void toWire(const std::string& source, TimeNs acquired_ns, std::uint32_t sequence, FrameState state,
            const std::vector<Measurement>& from, RunClock clock, v1::Measurement& to);
bool fromWire(const v1::Measurement& from, std::vector<Measurement>& to);

void toWire(const occupancy::Contribution& from, RunClock clock, v1::Contribution& to);
bool fromWire(const v1::Contribution& from, occupancy::Contribution& to);

void toWire(const occupancy::KeyframePose& from, RunClock clock, v1::KeyframePose& to);
bool fromWire(const v1::KeyframePose& from, occupancy::KeyframePose& to);

/// Does not fill the header. At most 256 ranges.
void toWire(const occupancy::Have& from, v1::Have& to);
bool fromWire(const v1::Have& from, occupancy::Have& to);

}  // namespace omnifleet::adapters
