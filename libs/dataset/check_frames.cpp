#include <fmt/format.h>

#include "dataset/frame_source.h"

namespace omnifleet::dataset {
namespace {

/// Throws if the stream names files and none of them is an image of the size of its calibration.
/// @return whether the stream has an image
bool checkStream(const std::string& folder, const ImageStream& stream) {
  const FrameSize size{stream.camera.image_width_px, stream.camera.image_height_px};
  std::vector<unsigned char> buffer;
  std::string first;
  std::size_t named = 0;
  for (const ImageRow& row : stream.rows) {
    if (row.path.empty()) continue;
    cv::Mat image;
    std::string fault;
    if (decodeImage(row.path, Colour::kGrey, size, buffer, image, fault) == FrameState::kOk) return true;
    if (named++ == 0) first = fmt::format("{} {}", row.path, fault);
  }
  if (named == 0) return false;
  throw options::Error(fmt::format(
      "{}/{}/data.csv: none of its {} frames can be read: {}. The column filename names the files in the "
      "folder data beside this file, with their extension",
      folder, stream.name, named, first));
}

/// Throws if `empty`, the only streams, name no file.
void failEmpty(const Dataset& dataset, const std::vector<const ImageStream*>& empty) {
  std::vector<std::string> rows;
  for (const ImageStream* stream : empty)
    rows.push_back(fmt::format("{} {}", stream->rows.size(), stream->name));
  throw options::Error(
      fmt::format("{}/{}/data.csv: no row names an image, so there is nothing to map (rows: {}). The column "
                  "filename names the "
                  "files in the folder data beside this file, with their extension",
                  dataset.folder, empty.front()->name, fmt::join(rows, ", ")));
}

}  // namespace

void checkFrames(const Dataset& dataset) {
  bool has_data = false;
  std::vector<const ImageStream*> empty;
  const auto check = [&](const ImageStream& stream) {
    if (checkStream(dataset.folder, stream)) return true;
    empty.push_back(&stream);
    return false;
  };
  for (const RobotRecording& robot : dataset.robots) {
    if (robot.fisheye) has_data |= check(*robot.fisheye);
    if (robot.front) has_data |= check(*robot.front);
    has_data |= !robot.laser.empty() || !robot.observations.empty();
  }
  for (const ImageStream& stream : dataset.ceiling) has_data |= check(stream);
  if (!has_data && !empty.empty()) failEmpty(dataset, empty);
}

}  // namespace omnifleet::dataset
