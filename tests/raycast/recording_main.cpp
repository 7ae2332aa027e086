// Writes a recording of the second renderer, for inspection and for results on images without tuning.

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <map>
#include <string>

#include "tests/raycast/recording.h"

int main(int argc, char** argv) try {
  using namespace omnifleet;
  const std::map<std::string, raycast::Floor> floors{{"lino", raycast::Floor::kLino},
                                                     {"parquet", raycast::Floor::kParquet},
                                                     {"carpet", raycast::Floor::kCarpet},
                                                     {"concrete", raycast::Floor::kConcrete}};
  const std::map<std::string, lens::Projection> projections{
      {"equidistant", lens::Projection::kEquidistant},
      {"equisolid", lens::Projection::kEquisolid},
      {"stereographic", lens::Projection::kStereographic}};
  const std::map<std::string, raycast::Light> lights{{"shadows", raycast::Light::kShadows},
                                                     {"lamp", raycast::Light::kOneLamp}};
  if (argc < 3 || argv[1][0] == '\0') {
    std::fputs(
        "usage: raycast_recording OUT SEED [FLOOR [PROJECTION [LIGHT [tape | shadows | lamp]]]]\n"
        "  OUT         folder of the recording\n"
        "  SEED        integer; sets room, paths and noise\n"
        "  FLOOR       lino (default), parquet, carpet or concrete\n"
        "  PROJECTION  equidistant (default), equisolid or stereographic\n"
        "  LIGHT       brightness, default 1 (bright)\n"
        "  tape        two strips of tape on the floor\n"
        "  shadows     two lamps that cast shadows\n"
        "  lamp        one lamp in a dark room, linear camera\n",
        stderr);
    return 2;
  }
  raycast::RecordingOptions options;
  options.seed = static_cast<unsigned>(std::strtoul(argv[2], nullptr, 10));
  if (argc > 3) options.floor = floors.at(argv[3]);
  if (argc > 4) options.projection = projections.at(argv[4]);
  if (argc > 5) options.light = std::strtod(argv[5], nullptr);
  for (int i = 6; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "tape")
      options.tape = true;
    else
      options.lit_by = lights.at(word);
  }
  raycast::record(argv[1], options);
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "raycast_recording: %s\n", error.what());
  return 1;
}
