#include <fmt/format.h>

#include "dataset/frame_source.h"

namespace omnifleet::dataset {
namespace {

/// Throws if the stream names files and none of them is an image of the size of its calibration.
void checkStream(const std::string& folder, const ImageStream& stream) {
  const FrameSize size{stream.camera.image_width_px, stream.camera.image_height_px};
  std::vector<unsigned char> buffer;
  std::string first;
  std::size_t named = 0;
  for (const ImageRow& row : stream.rows) {
    if (row.path.empty()) continue;
    cv::Mat image;
    std::string fault;
    if (decodeImage(row.path, Colour::kGrey, size, buffer, image, fault) == FrameState::kOk) return;
    if (named++ == 0) first = fmt::format("{} {}", row.path, fault);
  }
  if (named == 0) return;
  throw options::Error(fmt::format(
      "{}/{}/data.csv: none of its {} frames can be read: {}. The column filename names the files in the "
      "folder data beside this file, with their extension",
      folder, stream.name, named, first));
}

}  // namespace

void checkFrames(const Dataset& dataset) {
  for (const RobotRecording& robot : dataset.robots) {
    if (robot.fisheye) checkStream(dataset.folder, *robot.fisheye);
    if (robot.front) checkStream(dataset.folder, *robot.front);
  }
  for (const ImageStream& stream : dataset.ceiling) checkStream(dataset.folder, stream);
}

}  // namespace omnifleet::dataset
