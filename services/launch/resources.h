#pragma once

#include "bus/folder_claim.h"
#include "bus/shared_memory.h"
#include "launch/plan.h"

namespace omnifleet::launch {

/// Bytes of shared memory for the frames of the cameras on this host. Throws options::Error for a camera with
/// too large images.
std::size_t frameBytes(const RunRequest& request, const fleet::Fleet& fleet);

/// What a run has for itself on this machine from its start to its end: the run directory and the shared
/// memory of its frames.
class Resources {
 public:
  /// Call after checkBeforeStart() and before anything changes in the run directory. Throws options::Error
  /// when another fleet uses the directory or the memory does not suffice.
  Resources(const RunRequest& request, const fleet::Fleet& fleet);

 private:
  bus::FolderClaim folder_;
  bus::SharedMemoryReservation memory_;
};

}  // namespace omnifleet::launch
