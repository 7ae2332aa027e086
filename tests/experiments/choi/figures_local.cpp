#include <fmt/format.h>

#include "dataset/dataset.h"
#include "dataset/frame_source.h"
#include "figures.h"
#include "local_view.h"

namespace omnifleet::choi {
namespace {

using Picture = cv::Mat (*)(const LocalView&);

/// One robot's picture as printed and as ours.
void pair(const std::string& path, const std::string& what, Picture picture, const LocalView& literal,
          const LocalView& ours) {
  save(path,
       beside({picture(literal), picture(ours)}, {what + ", " + literal.robot + ": as printed", "ours"}));
}

/// Figs. 15–17: labels, vectors, corrected vectors, local map.
cv::Mat four(const LocalView& view) {
  return stacked(
      {beside({connectedPicture(view), vectorPicture(view)},
              {view.robot + ": labelling", "motion vectors, 3x"}),
       beside({correctedPicture(view), hullPicture(view)}, {"corrected motion vectors", "local map"})});
}

/// Fig. 14: the room from the ceiling.
void drawRoom(const std::string& ceiling, const std::string& path) {
  if (ceiling.empty()) return;
  const dataset::Dataset recording = dataset::Dataset::open(ceiling);
  cv::Mat image;
  dataset::FrameInfo info;
  if (recording.ceiling.empty() ||
      !dataset::openStream(recording.ceiling.front(), dataset::Colour::kBgr)->next(image, info)) {
    return;
  }
  save(path,
       beside({image}, {"V.1: floor of 5 cm grids, obstacles lower than the robots, seen from the ceiling"}));
}

}  // namespace

void drawLocalFigures(const SeedData& data, const std::string& folder) {
  const auto literal = localViews(data.fixed, {data.overlay}), ours = localViews(data.fixed, {});
  const std::string to = folder + "/";
  pair(to + "fig04_labelling.png", "labels before Algorithm 1", labelPicture, literal[0], ours[0]);
  pair(to + "fig05_connection.png", "regions after Algorithm 1", connectedPicture, literal[0], ours[0]);
  pair(to + "fig06_vectors.png", "motion vectors over 5 cm, 3 times as long", vectorPicture, literal[0],
       ours[0]);
  pair(to + "fig08_corrected.png", "corrected vectors", correctedPicture, literal[0], ours[0]);
  pair(to + "fig09_hulls.png", "convex hulls", hullPicture, literal[0], ours[0]);
  drawRoom(data.fixed_ceiling, to + "fig14_static_room.png");
  for (std::size_t i = 0; i < ours.size() && i < 3; ++i) {
    save(fmt::format("{}fig{}_{}.png", to, 15 + i, ours[i].robot), four(ours[i]));
    save(fmt::format("{}fig{}_{}_as_printed.png", to, 15 + i, literal[i].robot), four(literal[i]));
  }
}

void drawFigures(const SeedData& data, const std::string& folder) {
  drawLocalFigures(data, folder);
  drawGlobalFigures(data, folder);
  drawPathFigures(data, folder);
}

}  // namespace omnifleet::choi
