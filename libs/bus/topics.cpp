#include "bus/topics.h"

namespace omnifleet::bus {
namespace {

/// Streams: one sample per frame and key. Live mode keeps as many samples as a slow reader can still use.
/// Deterministic modes lose no sample: the history for late joiners holds what was sent between the match at
/// the writer and the match at the reader.
QosProfile stream(RunMode mode) {
  QosProfile qos;
  qos.keep_all = isDeterministic(mode);
  qos.transient_local = isDeterministic(mode);
  qos.depth = 16;
  return qos;
}

/// Journals: late joiners receive the history, 64 per robot at both ends. In deterministic modes the writer
/// waits for its readers. Otherwise a burst (the corrections at the end of a long run) would replace unread
/// samples.
QosProfile journal(RunMode mode) {
  QosProfile qos;
  qos.keep_all = isDeterministic(mode);
  qos.transient_local = true;
  qos.depth = 64;
  return qos;
}

/// The latest value, also for late joiners.
QosProfile latest(int instances = 64) {
  QosProfile qos;
  qos.transient_local = true;
  qos.depth = 1;
  qos.max_samples_per_instance = 1;
  qos.max_instances = instances;
  return qos;
}

QosProfile preview() {
  QosProfile qos;
  qos.reliable = false;
  qos.depth = 1;
  qos.max_samples_per_instance = 1;
  return qos;
}

/// The same, read only on the host of the robot.
QosProfile onHost(QosProfile qos) {
  qos.off_host = false;
  return qos;
}

/// Re-sent samples of the map. Volatile: a late joiner publishes in map/have what it lacks. A topic of its
/// own, so that re-sent samples do not push a robot's own samples out of the history that late joiners get
/// first.
QosProfile resends() {
  QosProfile qos;
  qos.depth = 64;
  return qos;
}

/// The status also reports that another process owns the robot.
QosProfile statuses() {
  QosProfile qos = latest(256);
  qos.while_outranked = true;
  return qos;
}

/// map/have, which replicas exchange continuously; only the latest sample counts.
QosProfile lastFew() {
  QosProfile qos;
  qos.depth = 4;
  return qos;
}

}  // namespace

Topics::Topics(RunMode mode)
    : camera_preview{"omnifleet/camera_preview", onHost(preview())},
      wheels_odometry{"omnifleet/wheels/odometry", onHost(stream(mode))},
      wheels_command{"omnifleet/wheels/command", onHost(stream(mode))},
      laser{"omnifleet/laser", onHost(stream(mode))},
      local_map{"omnifleet/local_map", onHost(stream(mode))},
      objects{"omnifleet/objects", onHost(stream(mode))},
      objects_kept{objects.name, onHost(journal(mode))},
      measurement{"omnifleet/measurement", stream(mode)},
      pose{"omnifleet/pose", stream(mode)},
      place{"omnifleet/place", journal(mode)},
      alignment{"omnifleet/alignment", latest()},
      map_contribution{"omnifleet/map/contribution", journal(mode)},
      map_keyframe_pose{"omnifleet/map/keyframe_pose", journal(mode)},
      map_have{"omnifleet/map/have", lastFew()},
      map_resend{"omnifleet/map/resend", resends()},
      map_octree{"omnifleet/map/octree", latest(4)},
      map_grid{"omnifleet/map/grid", latest(4)},
      map_outlines{"omnifleet/map/outlines", latest(1024)},
      map_hash{"omnifleet/map/hash", latest()},
      formation_command{"omnifleet/formation/command", latest()},
      formation_state{"omnifleet/formation/state", stream(mode)},
      service_status{"omnifleet/service/status", statuses()},
      election{"omnifleet/election", latest()},
      world_truth{"omnifleet/world/truth", onHost(stream(mode))},
      run_end{"omnifleet/run/end", latest(256)} {}

std::string cameraTopicName(const std::string& camera_id) {
  return "omnifleet/camera/" + camera_id;
}

QosProfile frameQos(RunMode mode) {
  QosProfile qos;
  qos.keep_all = isDeterministic(mode);
  qos.depth = isDeterministic(mode) ? 8 : 4;
  qos.max_instances = 1;
  qos.max_samples_per_instance = qos.depth;
  qos.data_sharing = true;
  // A data-sharing reader starts to read when it matches, later than its writer does. Only a history for late
  // joiners keeps the first frames of a run from being skipped.
  qos.transient_local = isDeterministic(mode);
  return qos;
}

}  // namespace omnifleet::bus
