// Writes a recording of the second renderer, for looking at and for figures that no tuning has seen.
// Usage: raycast_recording OUT SEED [FLOOR [PROJECTION [LIGHT [tape | shadows | lamp]]]]
// FLOOR: lino, parquet, carpet, concrete; PROJECTION: equidistant, equisolid, stereographic; LIGHT: 1 is
// bright; shadows: two lamps cast them; lamp: one does, in a dark room, a linear camera.

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
  if (argc < 3) {
    std::fputs("usage: raycast_recording OUT SEED [FLOOR [PROJECTION [LIGHT [tape | shadows | lamp]]]]\n",
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
