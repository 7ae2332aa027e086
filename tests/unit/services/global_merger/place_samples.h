#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "dataset/atomic_file.h"
#include "observation/observation.h"
#include "tests/unit/appearance/small_map.h"

namespace omnifleet::test {

/// Image number of a place: not its index, as most images are no places.
inline std::uint32_t imageOf(std::uint32_t index) {
  return 10 * index + 7;
}

/// Place on an arc, linked to the place before. `revision` moves it.
inline Place somePlace(const std::string& robot, std::uint32_t index, const std::string& frame = "",
                       double revision_m = 0.0) {
  Place place;
  place.robot = robot;
  place.index = index;
  place.sequence = imageOf(index);
  place.acquired_ns = 100'000'000 * static_cast<TimeNs>(place.sequence);
  place.frame = frame;
  place.frame_from_base = {0.1 * index, 0.02 * index + revision_m, 0.05 * index};
  place.covariance = Eigen::Vector3d(1e-4, 4e-4, 1e-6 * (1.0 + index)).asDiagonal();
  place.format = smallFormat();
  place.signature = smallSignature(index + (robot == "r1" ? 0 : 50));
  if (index > 0) {
    PlaceLink link;
    link.robot = robot;
    link.index = index - 1;
    link.this_from_other = {-0.1, 0.01 * index, -0.05};
    link.covariance = Eigen::Vector3d(0.01, 0.04, 0.0025).asDiagonal();
    place.links.push_back(link);
  }
  return place;
}

/// A g2o file of two dimensions as its format says, read without any code of the project.
struct G2oGraph {
  struct Edge {
    std::uint32_t from = 0, to = 0;
    std::vector<double> values;  ///< x, y, θ, upper triangle of the information
  };
  std::vector<std::pair<std::uint32_t, Eigen::Vector3d>> vertices;
  std::vector<Edge> edges;
  std::vector<std::uint32_t> fixed;
  std::vector<std::string> others;  ///< lines that are neither these nor comments

  std::vector<std::uint32_t> ids() const {
    std::vector<std::uint32_t> ids;
    for (const auto& [id, pose] : vertices) ids.push_back(id);
    return ids;
  }
};

inline G2oGraph readG2o(const std::string& path) {
  G2oGraph graph;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    std::istringstream fields(line);
    std::string tag;
    fields >> tag;
    std::uint32_t id = 0;
    if (tag == "VERTEX_SE2") {
      Eigen::Vector3d pose;
      fields >> id >> pose.x() >> pose.y() >> pose.z();
      graph.vertices.emplace_back(id, pose);
    } else if (tag == "EDGE_SE2") {
      G2oGraph::Edge edge;
      fields >> edge.from >> edge.to;
      for (double value = 0.0; fields >> value;) edge.values.push_back(value);
      graph.edges.push_back(edge);
    } else if (tag == "FIX") {
      fields >> id;
      graph.fixed.push_back(id);
    } else if (tag.empty() || tag[0] != '#') {
      graph.others.push_back(line);
    }
  }
  return graph;
}

/// Every file below a folder with its bytes, by its path from there.
inline std::map<std::string, std::string> filesBelow(const std::string& folder) {
  std::map<std::string, std::string> files;
  if (!std::filesystem::exists(folder)) return files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file())
      files[std::filesystem::relative(entry.path(), folder)] = dataset::readFile(entry.path());
  }
  return files;
}

}  // namespace omnifleet::test
