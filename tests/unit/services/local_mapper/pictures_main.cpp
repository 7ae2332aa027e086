// Runs the local mapper over a folder of images and writes debug images of each, for visual inspection.
// Usage: local_mapper_pictures SENSOR.yaml OPTIONS.yaml FOLDER OUT

#include <cstdio>

#include "dataset/frame_source.h"
#include "local_mapper/debug_images.h"
#include "local_mapper/local_mapper.h"

int main(int argc, char** argv) {
  using namespace omnifleet;
  if (argc < 5) return 2;
  const auto model = lens::CameraModel::load(argv[1]);
  const lens::Camera camera(model);
  const auto options = local_mapper::Options::read(options::Section::load(argv[2]));
  const auto source = dataset::openFolder(argv[3], dataset::Colour::kBgr,
                                          {model.image_width_px, model.image_height_px}, 1000000000);
  local_mapper::Frame frame;
  dataset::FrameInfo info;
  while (source->next(frame.image, info)) {
    local_mapper::LocalMapper mapper(camera, options);  // the images are no sequence
    frame.acquired_ns = info.time_ns;
    frame.sequence = info.sequence;
    frame.state = info.state;
    const LocalMap& map = mapper.process(frame, {});
    std::printf("%s: %s, %zu objects, %zu regions\n", info.where.c_str(), toString(map.state),
                map.objects.size(), mapper.connectedBlobs().size());
    local_mapper::DebugImages::render(mapper, map, frame.image)
        .save(std::string(argv[4]) + "/" + std::to_string(info.sequence));
  }
  return 0;
}
