#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "geometry/polygon.h"

namespace omnifleet::dataset {

/// One object of objects.geojson or scene.geojson; metres, map frame.
struct MapObject {
  std::uint64_t id = 0;
  std::string kind = "obstacle";  ///< obstacle | robot
  std::string name;               ///< of a named landmark; empty: not written
  Polygon outline_m;              ///< counter-clockwise, last vertex not repeated
  Eigen::Vector2d centroid_m = Eigen::Vector2d::Zero();
  int observations = 0;
  std::vector<std::string> observers;
  double height_m = 0.0;  ///< ≤ 0: unknown, not written
};

/// FeatureCollection of Polygons (closed rings, counter-clockwise), coordinates to 1 µm; deterministic text.
std::string objectsText(const std::vector<MapObject>& objects);
/// Atomic. Throws std::runtime_error.
void writeObjects(const std::string& path, const std::vector<MapObject>& objects);
/// Polygon and MultiPolygon features (each outer ring one object; holes are ignored); kind defaults to
/// obstacle, the centroid is taken from the polygon where the file has none. Throws std::runtime_error naming
/// file and feature.
std::vector<MapObject> readObjects(const std::string& path);

/// A grid as map_server reads it. Cell (0, 0) is at the lower left; index = x + y·width.
struct OccupancyGrid {
  int width = 0, height = 0;
  double resolution_m = 0.05;
  Eigen::Vector2d origin_m = Eigen::Vector2d::Zero();  ///< lower-left corner of cell (0, 0) in map
  std::vector<std::int8_t> cells;                      ///< −1 unknown, 0 free … 100 occupied
};
/// Writes STEM.pgm and STEM.yaml, each atomically (map_server: trinary; occupied 0, free 254, unknown 205).
/// Throws std::runtime_error, std::invalid_argument where cells.size() ≠ width·height.
void writeMapServer(const std::string& stem, const OccupancyGrid& grid);
/// Reads them back (binary PGM, any thresholds, `negate`). Throws std::runtime_error, options::Error for the
/// YAML.
OccupancyGrid readMapServer(const std::string& yaml_path);

}  // namespace omnifleet::dataset
