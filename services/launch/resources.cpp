#include "launch/resources.h"

#include "options/options.h"

namespace omnifleet::launch {
namespace {

bus::SharedMemoryReservation reserve(const RunRequest& request, const fleet::Fleet& fleet) {
  try {
    return bus::SharedMemoryReservation(frameBytes(request, fleet), request.out);
  } catch (const std::runtime_error& error) {
    throw options::Error(error.what());
  }
}

}  // namespace

std::size_t frameBytes(const RunRequest& request, const fleet::Fleet& fleet) {
  const bus::RunMode mode = modeOf(request, fleet) == "live" ? bus::RunMode::kLive : bus::RunMode::kReplay;
  std::size_t bytes = 0;
  for (const fleet::CameraSpec& camera : fleet.cameras) {
    if (!request.host.empty() && camera.host != request.host) continue;
    try {
      bytes += bus::frameChannelBytes(
          static_cast<std::size_t>(camera.model.image_width_px) * camera.model.image_height_px * 3, mode);
    } catch (const std::runtime_error& error) {
      throw options::Error("camera " + camera.id + ": " + error.what());
    }
  }
  return bytes;
}

Resources::Resources(const RunRequest& request, const fleet::Fleet& fleet)
    : folder_(request.out, request.fleet_file.empty() ? request.dataset : request.fleet_file, request.host),
      memory_(reserve(request, fleet)) {}

}  // namespace omnifleet::launch
