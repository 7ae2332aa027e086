#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "local_mapper/local_mapper.h"
#include "observation/observation.h"

namespace omnifleet::local_mapper {

/// The four images of Choi's Figs. 15–17 for one frame, BGR8.
struct DebugImages {
  cv::Mat labels;     ///< regions with their rectangles before (thin) and after (thick) Algorithm 1
  cv::Mat vectors;    ///< motion vectors on the fisheye image; dots mark where they begin
  cv::Mat corrected;  ///< the same vectors on the floor; in red the robot's own motion, which was removed
  cv::Mat local_map;  ///< scan, hulls, contacts, points in space coloured by height; 1 m grid, robot in the
                      ///< middle, forward is up

  /// @param mapper after process(image) returned `map`
  static DebugImages render(const LocalMapper& mapper, const LocalMap& map, const cv::Mat& image);

  /// Writes PREFIX_labels.png, PREFIX_vectors.png, PREFIX_corrected.png and PREFIX_local_map.png.
  /// @return one line per file that could not be written
  std::vector<std::string> save(const std::string& prefix) const;
};

/// Writes a picture and adds a description of the problem, if there is one.
void writePicture(const std::string& path, const cv::Mat& picture, std::vector<std::string>& problems);

}  // namespace omnifleet::local_mapper
