#include "bus/topics.h"

namespace omnifleet::bus {
namespace {

/// One sample per frame and key. Live keeps what a slow reader can still use. Deterministic runs lose
/// nothing, not even between the moments when a reader and its writer know of each other: hence a history for
/// late joiners.
QosProfile stream(RunMode mode) {
  QosProfile qos;
  qos.keep_all = isDeterministic(mode);
  qos.transient_local = isDeterministic(mode);
  qos.depth = 16;
  return qos;
}

/// A history that late joiners get, 64 per robot at both ends. Deterministic runs wait for their readers instead
/// of letting a burst (the corrections at the end of a long run) push out what nobody has read.
QosProfile journal(RunMode mode) {
  QosProfile qos;
  qos.keep_all = isDeterministic(mode);
  qos.transient_local = true;
  qos.depth = 64;
  return qos;
}

/// The latest value, for whoever comes.
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

/// map/have: what replicas tell each other all the time; only the last word counts.
QosProfile lastWord() {
  QosProfile qos;
  qos.depth = 4;
  return qos;
}

}  // namespace

Topics::Topics(RunMode mode)
    : camera_preview{"omnifleet/camera_preview", preview()},
      wheels_odometry{"omnifleet/wheels/odometry", stream(mode)},
      wheels_command{"omnifleet/wheels/command", stream(mode)},
      laser{"omnifleet/laser", stream(mode)},
      local_map{"omnifleet/local_map", stream(mode)},
      objects{"omnifleet/objects", stream(mode)},
      objects_kept{objects.name, journal(mode)},
      measurement{"omnifleet/measurement", stream(mode)},
      pose{"omnifleet/pose", stream(mode)},
      place{"omnifleet/place", journal(mode)},
      map_contribution{"omnifleet/map/contribution", journal(mode)},
      map_keyframe_pose{"omnifleet/map/keyframe_pose", journal(mode)},
      map_have{"omnifleet/map/have", lastWord()},
      map_octree{"omnifleet/map/octree", latest(4)},
      map_grid{"omnifleet/map/grid", latest(4)},
      map_outlines{"omnifleet/map/outlines", latest(4)},
      map_hash{"omnifleet/map/hash", latest()},
      formation_command{"omnifleet/formation/command", latest()},
      formation_state{"omnifleet/formation/state", stream(mode)},
      service_status{"omnifleet/service/status", latest(256)},
      world_truth{"omnifleet/world/truth", stream(mode)},
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
  // A data-sharing reader starts reading at the moment when it matches, later than its writer does: only a
  // history for late joiners makes sure that the first frames of a run are not skipped.
  qos.transient_local = isDeterministic(mode);
  return qos;
}

}  // namespace omnifleet::bus
