#pragma once

#include <string>
#include <vector>

#include "lens/camera.h"
#include "tests/raycast/arena_drive.h"
#include "tests/raycast/arena_options.h"

namespace omnifleet::raycast {

/// What an arena recording shows, before it is rendered.
struct ArenaStory {
  ArenaLayout layout;
  ArenaDrive drive;
  lens::CameraModel front;                 ///< of r1 and r2
  std::vector<lens::CameraModel> ceiling;  ///< c1, c2
  std::vector<TimeNs> front_times_ns, ceiling_times_ns;
  double move_s = 0.2, wait_s = 0.0;  ///< the robots move and stand in turn; 0: they never stand

  /// Time of the drive at a time of the recording, s: it does not pass while the robots stand.
  double driveTime(TimeNs time_ns) const;

  /// Poses of r1 to r4 at a time of the recording.
  std::vector<Pose2> posesAt(TimeNs time_ns) const;
};

/// Throws std::runtime_error if no arena, no paths or no images follow from the options.
ArenaStory arenaStory(const ArenaOptions& options);

/// Two robots with one forward camera each, without wheels and initial poses, map a divided arena; two
/// robots are parked; two ceiling cameras overlap in the middle third. Writes a data set with its truth.
/// Throws std::runtime_error like arenaStory() or if a file cannot be written.
void recordArena(const std::string& folder, const ArenaOptions& options);

}  // namespace omnifleet::raycast
