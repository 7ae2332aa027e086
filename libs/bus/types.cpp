// Descriptors of all generated types. Besides the frames, the only source that includes the type supports.

#include <fastrtps/utils/md5.h>
#include <fastdds/dds/topic/TopicDataType.hpp>

#include "bus/topics.h"
#include "idl/cameraPubSubTypes.h"
#include "idl/formationPubSubTypes.h"
#include "idl/hashes.h"
#include "idl/laserPubSubTypes.h"
#include "idl/local_mapPubSubTypes.h"
#include "idl/localizerPubSubTypes.h"
#include "idl/mapPubSubTypes.h"
#include "idl/objectsPubSubTypes.h"
#include "idl/servicePubSubTypes.h"
#include "idl/wheelsPubSubTypes.h"
#include "idl/worldPubSubTypes.h"

namespace omnifleet::bus {
namespace {

template <class Support>
std::string keyOf(const void* sample) {
  thread_local Support support;
  eprosima::fastrtps::rtps::InstanceHandle_t handle;
  if (!support.getKey(const_cast<void*>(sample), &handle, false)) return {};
  const auto* bytes = reinterpret_cast<const char*>(&handle.value[0]);
  return std::string(bytes, 16);
}

template <class Support>
TypeDescriptor make(const char* idl_hash) {
  using T = typename Support::type;
  TypeDescriptor type;
  type.name = Support().getName();
  type.idl_hash = idl_hash;
  type.create = []() -> std::shared_ptr<void> { return std::make_shared<T>(); };
  type.copy = [](void* to, const void* from) { *static_cast<T*>(to) = *static_cast<const T*>(from); };
  type.key = &keyOf<Support>;
  type.size = [](const void* sample) -> std::size_t {
    constexpr std::size_t kEncapsulation = 4;  // bytes before the fields
    return T::getCdrSerializedSize(*static_cast<const T*>(sample)) + kEncapsulation;
  };
  type.support = []() -> eprosima::fastdds::dds::TopicDataType* { return new Support(); };
  return type;
}

}  // namespace

template <>
const TypeDescriptor& describe<v1::CameraPreview>() {
  static const TypeDescriptor type = make<v1::CameraPreviewPubSubType>(v1::kCameraHash);
  return type;
}
template <>
const TypeDescriptor& describe<v1::WheelOdometry>() {
  static const TypeDescriptor type = make<v1::WheelOdometryPubSubType>(v1::kWheelsHash);
  return type;
}
template <>
const TypeDescriptor& describe<v1::WheelCommand>() {
  static const TypeDescriptor type = make<v1::WheelCommandPubSubType>(v1::kWheelsHash);
  return type;
}
template <>
const TypeDescriptor& describe<v1::LaserScan>() {
  static const TypeDescriptor type = make<v1::LaserScanPubSubType>(v1::kLaserHash);
  return type;
}
template <>
const TypeDescriptor& describe<v1::LocalMap>() {
  static const TypeDescriptor type = make<v1::LocalMapPubSubType>(v1::kLocalMapHash);
  return type;
}
template <>
const TypeDescriptor& describe<v1::Objects>() {
  static const TypeDescriptor type = make<v1::ObjectsPubSubType>(v1::kObjectsHash);
  return type;
}
template <>
const TypeDescriptor& describe<v1::Measurement>() {
  static const TypeDescriptor type = make<v1::MeasurementPubSubType>(v1::kLocalizerHash);
  return type;
}
template <>
const TypeDescriptor& describe<v1::Pose>() {
  static const TypeDescriptor type = make<v1::PosePubSubType>(v1::kLocalizerHash);
  return type;
}
template <>
const TypeDescriptor& describe<v1::Place>() {
  static const TypeDescriptor type = make<v1::PlacePubSubType>(v1::kLocalizerHash);
  return type;
}
template <>
const TypeDescriptor& describe<v1::Alignment>() {
  static const TypeDescriptor type = make<v1::AlignmentPubSubType>(v1::kLocalizerHash);
  return type;
}
template <>
const TypeDescriptor& describe<v1::Contribution>() {
  static const TypeDescriptor type = make<v1::ContributionPubSubType>(v1::kMapHash);
  return type;
}
template <>
const TypeDescriptor& describe<v1::KeyframePose>() {
  static const TypeDescriptor type = make<v1::KeyframePosePubSubType>(v1::kMapHash);
  return type;
}
template <>
const TypeDescriptor& describe<v1::Have>() {
  static const TypeDescriptor type = make<v1::HavePubSubType>(v1::kMapHash);
  return type;
}
template <>
const TypeDescriptor& describe<v1::Resend>() {
  static const TypeDescriptor type = make<v1::ResendPubSubType>(v1::kMapHash);
  return type;
}
template <>
const TypeDescriptor& describe<v1::OctreeMap>() {
  static const TypeDescriptor type = make<v1::OctreeMapPubSubType>(v1::kMapHash);
  return type;
}
template <>
const TypeDescriptor& describe<v1::Grid>() {
  static const TypeDescriptor type = make<v1::GridPubSubType>(v1::kMapHash);
  return type;
}
template <>
const TypeDescriptor& describe<v1::Outlines>() {
  static const TypeDescriptor type = make<v1::OutlinesPubSubType>(v1::kMapHash);
  return type;
}
template <>
const TypeDescriptor& describe<v1::MapHash>() {
  static const TypeDescriptor type = make<v1::MapHashPubSubType>(v1::kMapHash);
  return type;
}
template <>
const TypeDescriptor& describe<v1::FormationCommand>() {
  static const TypeDescriptor type = make<v1::FormationCommandPubSubType>(v1::kFormationHash);
  return type;
}
template <>
const TypeDescriptor& describe<v1::FormationState>() {
  static const TypeDescriptor type = make<v1::FormationStatePubSubType>(v1::kFormationHash);
  return type;
}
template <>
const TypeDescriptor& describe<v1::Candidacy>() {
  static const TypeDescriptor type = make<v1::CandidacyPubSubType>(v1::kServiceHash);
  return type;
}
template <>
const TypeDescriptor& describe<v1::ServiceStatus>() {
  static const TypeDescriptor type = make<v1::ServiceStatusPubSubType>(v1::kServiceHash);
  return type;
}
template <>
const TypeDescriptor& describe<v1::Truth>() {
  static const TypeDescriptor type = make<v1::TruthPubSubType>(v1::kWorldHash);
  return type;
}
template <>
const TypeDescriptor& describe<v1::RunEnd>() {
  static const TypeDescriptor type = make<v1::RunEndPubSubType>(v1::kWorldHash);
  return type;
}

}  // namespace omnifleet::bus
