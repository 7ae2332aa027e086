#pragma once

// All topics of the project (idl/README.md). Names have the prefix omnifleet/.

#include <string>

#include "bus/topic.h"
#include "bus/type_descriptor.h"
#include "idl/camera.h"
#include "idl/formation.h"
#include "idl/laser.h"
#include "idl/local_map.h"
#include "idl/localizer.h"
#include "idl/map.h"
#include "idl/objects.h"
#include "idl/service.h"
#include "idl/wheels.h"
#include "idl/world.h"

namespace omnifleet::bus {

/// All topics with the QoS of one run mode. A value type, created with the bus.
struct Topics {
  explicit Topics(RunMode mode);

  Topic<v1::CameraPreview> camera_preview;   ///< key camera; best effort
  Topic<v1::WheelOdometry> wheels_odometry;  ///< per robot
  Topic<v1::WheelCommand> wheels_command;    ///< per robot
  Topic<v1::LaserScan> laser;                ///< per robot
  Topic<v1::LocalMap> local_map;             ///< per robot
  Topic<v1::Objects> objects;                ///< per robot
  Topic<v1::Objects> objects_kept;  ///< the topic of `objects` with the QoS of classifiers and of a restarted
                                    ///< localizer (transient local, history 64)
  Topic<v1::Measurement> measurement;             ///< key source
  Topic<v1::Pose> pose;                           ///< per robot
  Topic<v1::Place> place;                         ///< per robot; transient local, history 64
  Topic<v1::Alignment> alignment;                 ///< per robot; transient local, last 1
  Topic<v1::Contribution> map_contribution;       ///< per robot; transient local, history 64
  Topic<v1::KeyframePose> map_keyframe_pose;      ///< per robot; transient local, history 64
  Topic<v1::Have> map_have;                       ///< key replica
  Topic<v1::Resend> map_resend;                   ///< key replica
  Topic<v1::OctreeMap> map_octree;                ///< transient local, last 1
  Topic<v1::Grid> map_grid;                       ///< transient local, last 1
  Topic<v1::Outlines> map_outlines;               ///< per tile; transient local, last 1
  Topic<v1::MapHash> map_hash;                    ///< key replica; transient local, last 1
  Topic<v1::FormationCommand> formation_command;  ///< key fleet; transient local, last 1
  Topic<v1::FormationState> formation_state;      ///< per robot
  Topic<v1::ServiceStatus> service_status;        ///< key service + instance; transient local, last 1
  Topic<v1::Candidacy> election;                  ///< key office + candidate; transient local, last 1
  Topic<v1::Truth> world_truth;                   ///< per robot; world's renderers and evaluate only
  Topic<v1::RunEnd> run_end;                      ///< key stream; transient local, last 1
};

/// Topic name of the frames of a camera.
std::string cameraTopicName(const std::string& camera_id);
/// QoS of frames. Live: keep the last 4, best-effort readers. Deterministic modes: keep all 8, reliable.
QosProfile frameQos(RunMode mode);

template <>
const TypeDescriptor& describe<v1::CameraPreview>();
template <>
const TypeDescriptor& describe<v1::WheelOdometry>();
template <>
const TypeDescriptor& describe<v1::WheelCommand>();
template <>
const TypeDescriptor& describe<v1::LaserScan>();
template <>
const TypeDescriptor& describe<v1::LocalMap>();
template <>
const TypeDescriptor& describe<v1::Objects>();
template <>
const TypeDescriptor& describe<v1::Measurement>();
template <>
const TypeDescriptor& describe<v1::Pose>();
template <>
const TypeDescriptor& describe<v1::Place>();
template <>
const TypeDescriptor& describe<v1::Alignment>();
template <>
const TypeDescriptor& describe<v1::Contribution>();
template <>
const TypeDescriptor& describe<v1::KeyframePose>();
template <>
const TypeDescriptor& describe<v1::Have>();
template <>
const TypeDescriptor& describe<v1::Resend>();
template <>
const TypeDescriptor& describe<v1::OctreeMap>();
template <>
const TypeDescriptor& describe<v1::Grid>();
template <>
const TypeDescriptor& describe<v1::Outlines>();
template <>
const TypeDescriptor& describe<v1::MapHash>();
template <>
const TypeDescriptor& describe<v1::FormationCommand>();
template <>
const TypeDescriptor& describe<v1::FormationState>();
template <>
const TypeDescriptor& describe<v1::ServiceStatus>();
template <>
const TypeDescriptor& describe<v1::Candidacy>();
template <>
const TypeDescriptor& describe<v1::Truth>();
template <>
const TypeDescriptor& describe<v1::RunEnd>();

}  // namespace omnifleet::bus
