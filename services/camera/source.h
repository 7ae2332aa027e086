#pragma once

#include <memory>

#include "dataset/frame_source.h"
#include "fleet/fleet.h"

namespace omnifleet::services {

/// Where the frames of a camera that is not rendered come from: recording, folder, video or device. Throws
/// options::Error naming what cannot be opened.
std::unique_ptr<dataset::FrameSource> openSource(const fleet::CameraSpec& camera, const fleet::Fleet& fleet);

/// Opens and closes a folder, video or device, so that a launcher can tell before it starts anything. Throws
/// options::Error naming the fleet file, the camera and what cannot be opened; and for a recording or folder
/// all of whose first frames have another size than sensor.yaml says, that and theirs.
void checkSource(const fleet::CameraSpec& camera, const fleet::Fleet& fleet);

}  // namespace omnifleet::services
