#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "geometry/polygon.h"

namespace omnifleet::dataset {

/// One object of objects.geojson or scene.geojson. Metres, map frame.
struct MapObject {
  std::uint64_t id = 0;
  std::string kind = "obstacle";  ///< obstacle | robot | structure: an open outline of walls or furniture
  std::string name;               ///< name of a landmark; not written if empty
  Polygon outline_m;              ///< counter-clockwise, last vertex not repeated; structure: a polyline
  Eigen::Vector2d centroid_m = Eigen::Vector2d::Zero();
  int observations = 0;
  std::vector<std::string> observers;
  double height_m = 0.0;  ///< ≤ 0: unknown, not written
  Eigen::Matrix2d covariance_m2 =
      Eigen::Matrix2d::Zero();  ///< of the centroid; structure: of its points. Zero: unknown, not written
  std::vector<std::string> quality;  ///< codes of what is uncertain; see docs/methods/global_merger.md

  bool isOpen() const { return kind == "structure"; }
  /// Metres from a point to the outline; 0 inside of a closed one.
  double distanceTo(const Eigen::Vector2d& at_m) const;
};

/// A candidate that is not in the map. Metres, map frame.
struct RejectedPlace {
  Eigen::Vector2d at_m = Eigen::Vector2d::Zero();
  std::string reason;    ///< code; see docs/methods/global_merger.md
  int observations = 0;  ///< number of views
};

/// GeoJSON FeatureCollection of Polygons (closed rings, counter-clockwise), of LineStrings for structure, and
/// of Points (kind rejected) for rejected candidates. Coordinates rounded to 1 µm. Deterministic text.
/// @param frame of the coordinates: member `frame` of the collection. Empty: `map`, not written
std::string objectsText(const std::vector<MapObject>& objects,
                        const std::vector<RejectedPlace>& rejected = {}, const std::string& frame = {});
/// Writes atomically. Throws std::runtime_error.
void writeObjects(const std::string& path, const std::vector<MapObject>& objects,
                  const std::vector<RejectedPlace>& rejected = {}, const std::string& frame = {});
/// Reads Polygon, MultiPolygon and closed LineString features, and open LineStrings of kind structure. Each
/// outer ring becomes one object; holes are ignored. A property that is null counts as absent. The default
/// kind is obstacle; a missing centroid is computed from the polygon. Covariances and quality are not read.
/// Throws std::runtime_error that names file, feature and property.
/// @param passed_over receives one line for each other feature, except rejected candidates: "FILE: feature N:
/// problem"
std::vector<MapObject> readObjects(const std::string& path, std::vector<std::string>* passed_over = nullptr);

/// An occupancy grid as map_server reads it. Cell (0, 0) is at the lower left; index = x + y·width.
struct OccupancyGrid {
  int width = 0, height = 0;
  double resolution_m = 0.05;
  Eigen::Vector2d origin_m = Eigen::Vector2d::Zero();  ///< lower-left corner of cell (0, 0) in map
  std::vector<std::int8_t> cells;                      ///< −1 unknown, 0 free … 100 occupied
};
/// Writes STEM.pgm and STEM.yaml, each atomically (map_server: trinary; occupied 0, free 254, unknown 205).
/// Throws std::runtime_error, or std::invalid_argument if cells.size() ≠ width·height.
/// @param frame of the origin: key `frame` of the YAML, which map_server ignores. Empty: `map`, not written
void writeMapServer(const std::string& stem, const OccupancyGrid& grid, const std::string& frame = {});
/// Reads such a pair of files (binary PGM, any thresholds, `negate`). Throws std::runtime_error, or
/// options::Error for the YAML.
OccupancyGrid readMapServer(const std::string& yaml_path);

}  // namespace omnifleet::dataset
