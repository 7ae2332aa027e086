#include "camera/source.h"

#include <filesystem>

#include "dataset/dataset.h"

namespace omnifleet::services {

std::unique_ptr<dataset::FrameSource> openSource(const fleet::CameraSpec& camera, const fleet::Fleet& fleet) {
  const dataset::FrameSize size{camera.model.image_width_px, camera.model.image_height_px};
  const auto colour = dataset::Colour::kBgr;
  switch (camera.source) {
    case fleet::CameraSource::kDataset: {
      const dataset::Dataset recording = dataset::Dataset::open(fleet.dataset);
      return dataset::openStream(*recording.findStream(camera.id), colour);
    }
    case fleet::CameraSource::kFolder:
      return dataset::openFolder(camera.path, colour, size, static_cast<TimeNs>(1e9 / camera.rate_hz));
    case fleet::CameraSource::kVideo:
      return dataset::openVideo(camera.path, colour, size);
    case fleet::CameraSource::kDevice:
    case fleet::CameraSource::kArena:
      break;
  }
  throw std::logic_error("devices and arena cameras have services of their own");
}

namespace {

/// One or two frames of another size are faulty frames. If all first frames differ, the calibration is wrong.
void checkSize(dataset::FrameSource& source) {
  constexpr int kFrames = 3;
  cv::Mat image;
  dataset::FrameInfo info;
  int frames = 0;
  for (; frames < kFrames && source.next(image, info); ++frames) {
    if (info.state != FrameState::kWrongSize) return;
  }
  if (frames > 0)
    throw options::Error(info.where + ": " + info.fault +
                         "; all first frames differ from sensor.yaml. Use the sensor.yaml of this camera");
}

}  // namespace

void checkSource(const fleet::CameraSpec& camera, const fleet::Fleet& fleet) {
  if (camera.source == fleet::CameraSource::kArena || camera.source == fleet::CameraSource::kDevice) return;
  if (camera.source == fleet::CameraSource::kDataset) {
    const auto images = std::filesystem::path(fleet.dataset) / camera.id / "data";
    if (!std::filesystem::is_directory(images))
      throw options::Error(images.string() + ": no such folder; put the images of " + camera.id + " there");
    checkSize(*openSource(camera, fleet));
    return;
  }
  try {
    const auto source = openSource(camera, fleet);
    if (camera.source == fleet::CameraSource::kFolder) checkSize(*source);
  } catch (const options::Error& error) {
    throw options::Error(fleet.file.file() + ": cameras." + camera.id + ": " + error.what());
  }
}

}  // namespace omnifleet::services
