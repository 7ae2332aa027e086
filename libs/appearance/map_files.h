#pragma once

#include <opencv2/core.hpp>
#include <string>

#include "appearance/topological_map.h"

namespace omnifleet::appearance {

/// What a saved map contains. Its poses and links are those of the places.
struct SavedMap {
  std::string robot, frame;
  MapScale scale;
  SignatureFormat format;
  std::vector<Place> places;
};

SavedMap contentOf(const TopologicalMap& map);

/// Writes PATH, a g2o text (VERTEX_SE2, whose number is that of the image in its stream; EDGE_SE2 from the
/// later to the earlier place; links to places of other robots are left out), and PATH.signatures with the
/// signatures, the times and what else g2o cannot hold. Each file has a SHA-256, and each names that of the
/// other, so files of different maps do not combine. Both are written atomically. Throws std::runtime_error.
void saveMap(const std::string& path, const SavedMap& map);
inline void saveMap(const std::string& path, const TopologicalMap& map) {
  saveMap(path, contentOf(map));
}

/// Throws std::runtime_error that names the file and the problem if a file is missing, cut short or altered,
/// or if the two do not belong together. Nothing is read in part.
SavedMap loadMap(const std::string& path);

/// Picture of a map: nodes with their headings, links (loop closures in red), a scale bar. @param size_px of
/// the longer side; BGR
cv::Mat3b drawMap(const std::vector<Place>& places, int size_px = 900);

}  // namespace omnifleet::appearance
