#pragma once

#include "fleet/fleet.h"

namespace omnifleet::services {

/// Reads all options of all services, as the services do. Throws options::Error for the first unknown option,
/// wrong type or value out of range, so that no service starts with an invalid option.
void checkOptions(const fleet::Fleet& fleet);

/// Throws options::Error for a camera whose lens model cannot be inverted or that cannot see the floor, as
/// the local mapper does.
void checkCameras(const fleet::Fleet& fleet);

/// Throws options::Error when the run directory is the recording or a folder in it: recordings are never
/// modified.
void checkOutput(const fleet::Fleet& fleet, const std::string& out);

/// Creates an output folder. Throws options::Error when it is not writable, before a run whose results would
/// be lost.
void makeOutput(const std::string& folder);

/// Removes the trajectory, covariance and localization files of an earlier run from the run directory.
/// Otherwise the file of a robot that is never localized in this run would be an old one. Only on a host
/// (empty: any) that runs a global merger, and only at the start of a run: a restarted merger must keep the
/// trajectories of robots that have finished. Throws options::Error.
void removeOldTrajectories(const fleet::Fleet& fleet, const std::string& out, const std::string& host = {});

}  // namespace omnifleet::services
