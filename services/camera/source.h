#pragma once

#include <memory>

#include "dataset/frame_source.h"
#include "fleet/fleet.h"

namespace omnifleet::services {

/// The frame source of a camera that is neither rendered nor a device: recording, folder or video. Throws
/// options::Error that names what cannot be opened.
std::unique_ptr<dataset::FrameSource> openSource(const fleet::CameraSpec& camera, const fleet::Fleet& fleet);

/// Opens and closes a folder or video, so that a launcher can check it before the start. A device may come
/// later (DeviceCameraService). Throws options::Error that names the fleet file, the camera and what cannot
/// be opened. Also throws when the first frames of a recording or folder all differ in size from sensor.yaml,
/// with both sizes.
void checkSource(const fleet::CameraSpec& camera, const fleet::Fleet& fleet);

}  // namespace omnifleet::services
