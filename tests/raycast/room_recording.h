#pragma once

#include <string>
#include <vector>

#include "dataset/dataset.h"
#include "tests/raycast/furnished_options.h"
#include "tests/raycast/furnished_room.h"
#include "tests/raycast/room_path.h"

namespace omnifleet::raycast {

/// What a recording shows, before it is rendered.
struct FurnishedScene {
  House house;
  Drive drive;
  Room room;
  lens::CameraModel camera;                 ///< of every robot
  std::vector<std::vector<Solid>> persons;  ///< per frame; empty without options.occluded_share
};

/// Throws std::runtime_error if the options contradict each other or if no free path exists.
/// @param plan chooses starts and goals in the free space; null: random
FurnishedScene furnishedScene(const FurnishedOptions& options, Random& random,
                              const std::function<DrivePlan(const FreeSpace&)>& plan = nullptr);

/// Initial poses, bodies and wheels of the robots of a scene; their names are r1, r2, ….
std::vector<dataset::RobotRecording> robotsOf(const FurnishedOptions& options, const DriveFrame& first,
                                              Random& random);

/// Writes images, wheels and true poses of one robot of a scene.
void writeRobot(const std::string& folder, const std::string& name, std::size_t robot,
                const FurnishedScene& scene, const FurnishedOptions& options, Random& random);

/// Footprints of the furniture.
std::vector<dataset::MapObject> truthOf(const House& house);

/// Robots drive smooth paths between random goals in a furnished room. Writes a data set with poses,
/// footprints of the furniture (scene.geojson) and the inside of the walls (room.geojson). Persons are not in
/// the truth. Throws std::runtime_error like furnishedScene() or if a file cannot be written.
void recordFurnished(const std::string& folder, const FurnishedOptions& options);

}  // namespace omnifleet::raycast
