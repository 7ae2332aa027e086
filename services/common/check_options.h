#pragma once

#include "fleet/fleet.h"

namespace omnifleet::services {

/// Reads every option of every service as the services themselves will. Throws options::Error for the first
/// that is unknown, of a wrong type or out of range, so that nothing is started with a bad one.
void checkOptions(const fleet::Fleet& fleet);

/// Throws options::Error for a camera whose lens cannot be inverted or that sees no floor, as its stage will.
void checkCameras(const fleet::Fleet& fleet);

/// Throws options::Error when the run directory is the recording or lies in it: recordings are never written
/// to.
void checkOutput(const fleet::Fleet& fleet, const std::string& out);

/// Makes a folder to write to. Throws options::Error where nothing can be written, before the run whose
/// results would be lost.
void makeOutput(const std::string& folder);

/// Removes the paths that an earlier run left there: no map that is saved later replaces that of a robot that
/// is never located now. Only where this host (empty: any) merges, and at the start of a run: a merger that
/// takes over must not lose the paths of robots that are done. Throws options::Error.
void forgetPaths(const fleet::Fleet& fleet, const std::string& out, const std::string& host = {});

}  // namespace omnifleet::services
