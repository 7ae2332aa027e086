#include "global_merger/floor_markings.h"

#include <algorithm>
#include <cmath>

#include "geometry/polygon.h"

namespace omnifleet::global_merger {

namespace {

constexpr double kBeside_m = 0.05;  // m beside a marking: the noise of its outline
constexpr double kMost = 0.9;       // share of a track's rays that end in markings

struct Ends {
  int all = 0, in_markings = 0;
};

}  // namespace

std::set<std::pair<std::string, std::uint16_t>> tracksOfFloorMarkings(
    const std::vector<Polygon>& markings_m, const occupancy::ContributionStore& store) {
  if (markings_m.empty()) return {};
  const auto isInMarking = [&](const Eigen::Vector2d& at_m) {
    return std::any_of(markings_m.begin(), markings_m.end(),
                       [&](const Polygon& marking_m) { return distanceTo(marking_m, at_m) < kBeside_m; });
  };
  std::map<std::pair<std::string, std::uint16_t>, Ends> tracks;
  for (const auto& [robot, path] : store.robots()) {
    for (const auto& [time_ns, keyframe] : path) {
      const occupancy::KeyframePose* pose = store.poseOf(keyframe);
      if (!keyframe.corrected || pose == nullptr) continue;
      const occupancy::Contribution& seen = *keyframe.corrected;
      const Pose2 map_from_base = pose->mapFromBase();
      const Eigen::Vector2d foot_m(seen.scan_origin.x_dmm * 1e-4, seen.scan_origin.y_dmm * 1e-4);
      const std::size_t rays = std::min(seen.range_dmm.size(), seen.object.size());
      for (std::size_t i = 0; i < rays; ++i) {
        if (seen.object[i] == 0 || seen.range_dmm[i] <= 0) continue;
        const double bearing =
            2.0 * M_PI * static_cast<double>(i) / static_cast<double>(seen.range_dmm.size());
        const Eigen::Vector2d along(std::cos(bearing), std::sin(bearing));
        Ends& ends = tracks[{robot, seen.object[i]}];
        ++ends.all;
        ends.in_markings += isInMarking(map_from_base * (foot_m + seen.range_dmm[i] * 1e-4 * along)) ? 1 : 0;
      }
    }
  }
  std::set<std::pair<std::string, std::uint16_t>> of_markings;
  for (const auto& [track, ends] : tracks)
    if (ends.in_markings >= kMost * ends.all) of_markings.insert(track);
  return of_markings;
}

}  // namespace omnifleet::global_merger
