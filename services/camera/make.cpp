#include "camera/arena_service.h"
#include "camera/device_service.h"
#include "camera/service.h"

namespace omnifleet::services {

std::unique_ptr<bus::Service> makeCamera(const bus::ServiceContext& context) {
  const auto& o = context.options;
  const fleet::Fleet fleet = fleet::Fleet::load(o.fleet, o.dataset, o.configs);
  const fleet::CameraSource source = fleet.camera(o.camera).source;
  if (source == fleet::CameraSource::kArena) return std::make_unique<ArenaCameraService>(context, fleet);
  if (source == fleet::CameraSource::kDevice) return std::make_unique<DeviceCameraService>(context, fleet);
  return std::make_unique<CameraService>(context, fleet);
}

}  // namespace omnifleet::services
