#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "dataset/markers.h"
#include "markers/patch_finder.h"

namespace omnifleet::markers {

/// A region of a marker and the pixel at which the user points.
struct Pick {
  std::string robot;   ///< empty: the team patch of all robots
  std::string region;  ///< cover, tail, head, team or individual
  cv::Point pixel;
};

/// A picked region.
struct PickedRegion {
  Pick pick;
  dataset::Rgb rgb{};  ///< median of the region
  int area_px = 0;
  std::vector<cv::Point> pixels;
};

/// "X,Y". Throws options::Error that names the option.
cv::Point pixelFromText(const std::string& option, const std::string& text);

/// The 4-connected region of about the colour around a pixel and its median colour. Throws options::Error
/// that names robot and region if the pixel is outside the image or fewer than 4 pixels have its colour.
PickedRegion pickRegion(const cv::Mat& bgr, const Pick& pick);

/// Enters the colours of the picked regions. Throws options::Error when a robot lacks a region, a colour is
/// not usable (FinderOptions), two robots look alike, or two different colours of the set are so near that
/// their pixels may be confused; it names both and their distance.
void enterColours(const std::vector<PickedRegion>& regions, const FinderOptions& options,
                  dataset::MarkerSet& markers);

/// The image, twice as large, with the outline, name and colour of each picked region.
cv::Mat pictureOf(const cv::Mat& bgr, const std::vector<PickedRegion>& regions);

}  // namespace omnifleet::markers
