#include <fmt/format.h>

#include "dataset/dataset.h"
#include "dataset/frame_source.h"
#include "figures.h"
#include "local_view.h"

namespace omnifleet::choi {
namespace {

using Picture = cv::Mat (*)(const LocalView&);

/// One robot's picture with both methods side by side.
void pair(const std::string& path, const std::string& what, Picture picture, const LocalView& literal,
          const LocalView& omnifleet) {
  save(path, beside({picture(literal), picture(omnifleet)},
                    {what + ", " + literal.robot + ": as printed", "omnifleet"}));
}

/// Figs. 15–17: labels, vectors, corrected vectors and local map of one robot.
cv::Mat four(const LocalView& view) {
  return stacked(
      {beside({connectedPicture(view), vectorPicture(view)},
              {view.robot + ": labels", "motion vectors, drawn 3x"}),
       beside({correctedPicture(view), hullPicture(view)}, {"corrected motion vectors", "local map"})});
}

/// Fig. 14: the room seen from the ceiling.
void drawRoom(const std::string& ceiling, const std::string& path) {
  if (ceiling.empty()) return;
  const dataset::Dataset recording = dataset::Dataset::open(ceiling);
  cv::Mat image;
  dataset::FrameInfo info;
  if (recording.ceiling.empty() ||
      !dataset::openStream(recording.ceiling.front(), dataset::Colour::kBgr)->next(image, info)) {
    return;
  }
  save(path, beside({image},
                    {"V.1: floor with a 5 cm grid, obstacles lower than the robots, seen from the ceiling"}));
}

}  // namespace

void drawLocalFigures(const SeedData& data, const std::string& folder) {
  const auto literal = localViews(data.fixed, {data.overlay}), omnifleet = localViews(data.fixed, {});
  const std::string to = folder + "/";
  pair(to + "fig04_labelling.png", "labels before Algorithm 1", labelPicture, literal[0], omnifleet[0]);
  pair(to + "fig05_connection.png", "regions after Algorithm 1", connectedPicture, literal[0], omnifleet[0]);
  pair(to + "fig06_vectors.png", "motion vectors over 5 cm, drawn 3x", vectorPicture, literal[0],
       omnifleet[0]);
  pair(to + "fig08_corrected.png", "corrected vectors", correctedPicture, literal[0], omnifleet[0]);
  pair(to + "fig09_hulls.png", "convex hulls", hullPicture, literal[0], omnifleet[0]);
  drawRoom(data.fixed_ceiling, to + "fig14_static_room.png");
  for (std::size_t i = 0; i < omnifleet.size() && i < 3; ++i) {
    save(fmt::format("{}fig{}_{}.png", to, 15 + i, omnifleet[i].robot), four(omnifleet[i]));
    save(fmt::format("{}fig{}_{}_as_printed.png", to, 15 + i, literal[i].robot), four(literal[i]));
  }
}

void drawFigures(const SeedData& data, const std::string& folder) {
  drawLocalFigures(data, folder);
  drawGlobalFigures(data, folder);
  drawPathFigures(data, folder);
}

}  // namespace omnifleet::choi
