#include "dataset/track_files.h"

#include <fmt/format.h>

#include "dataset/csv.h"

namespace omnifleet::dataset {

TracksWriter::TracksWriter(const std::string& out, const std::string& robot)
    : csv_(out + "/tracks/" + robot + ".csv", "#timestamp [ns],track,kind,x [m],y [m]") {}

void TracksWriter::write(const Objects& objects) {
  for (const Track& track : objects.tracks) {
    if (!track.visible) continue;
    csv_.row(fmt::format("{},{},{},{:.4f},{:.4f}", objects.acquired_ns, track.id, toString(track.kind),
                         track.position_m.x(), track.position_m.y()));
  }
}

std::vector<TrackRow> readTracks(const std::string& path, std::vector<std::string>& warnings) {
  std::vector<TrackRow> rows;
  readRows(path, ',', warnings, [&](const std::vector<std::string_view>& fields) -> std::string {
    TrackRow row;
    TimeNs track = 0;
    if (fields.size() != 5 || !parseTime(fields[0], row.time_ns) || !parseTime(fields[1], track) ||
        !parseNumber(fields[3], row.position_m.x()) || !parseNumber(fields[4], row.position_m.y())) {
      return "expected timestamp [ns],track,kind,x [m],y [m]";
    }
    row.track = static_cast<std::uint32_t>(track);
    for (const ObjectKind kind : {ObjectKind::kUnknown, ObjectKind::kObstacle, ObjectKind::kRobot}) {
      if (fields[2] == toString(kind)) {
        row.kind = kind;
        rows.push_back(row);
        return {};
      }
    }
    return "the kind must be one of unknown, obstacle, robot";
  });
  return rows;
}

}  // namespace omnifleet::dataset
