#include "markers/markers_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <map>
#include <opencv2/imgproc.hpp>

#include "markers/layout.h"

namespace omnifleet::markers {
namespace {

constexpr double kRegionChroma = 0.2;  // a pixel of the region differs less from the picked pixel
constexpr int kSeed_px = 1;            // half side of the square whose median is the picked colour
constexpr std::size_t kLeastPixels = 4;
constexpr std::size_t kMostPixels = 40000;  // a larger region is the floor

std::string nameOf(const Pick& pick) {
  return pick.robot.empty() ? pick.region : pick.robot + ": " + pick.region;
}

dataset::Rgb rgbAt(const cv::Mat& bgr, const cv::Point& p) {
  const std::uint8_t* pixel = bgr.ptr<std::uint8_t>(p.y) + 3 * p.x;
  return {pixel[2], pixel[1], pixel[0]};
}

dataset::Rgb median(const cv::Mat& bgr, const std::vector<cv::Point>& pixels) {
  dataset::Rgb result{};
  for (std::size_t c = 0; c < 3; ++c) {
    std::vector<std::uint8_t> values;
    for (const cv::Point& p : pixels) values.push_back(rgbAt(bgr, p)[c]);
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    result[c] = *middle;
  }
  return result;
}

dataset::Rgb& colourOf(const Pick& pick, dataset::MarkerSet& markers) {
  if (pick.region == "team") return markers.team;
  dataset::RobotColours& colours = markers.robots[pick.robot];
  if (pick.region == "individual") return colours.individual;
  if (pick.region == "cover") return colours.cover;
  return pick.region == "tail" ? colours.tail : colours.head;
}

}  // namespace

cv::Point pixelFromText(const std::string& option, const std::string& text) {
  char* end = nullptr;
  const long x = std::strtol(text.c_str(), &end, 10);
  if (end != text.c_str() && *end == ',') {
    const char* second = end + 1;
    const long y = std::strtol(second, &end, 10);
    if (end != second && *end == '\0' && std::abs(x) < 100000 && std::abs(y) < 100000)
      return {static_cast<int>(x), static_cast<int>(y)};
  }
  throw options::Error(fmt::format("{}: '{}' must be X,Y, the column and the row of a pixel", option, text));
}

PickedRegion pickRegion(const cv::Mat& bgr, const Pick& pick) {
  const cv::Rect image({0, 0}, bgr.size());
  if (!image.contains(pick.pixel)) {
    throw options::Error(fmt::format("{}: pixel {},{} is outside the image of {}x{} pixels", nameOf(pick),
                                     pick.pixel.x, pick.pixel.y, bgr.cols, bgr.rows));
  }
  std::vector<cv::Point> square;
  for (int dy = -kSeed_px; dy <= kSeed_px; ++dy)
    for (int dx = -kSeed_px; dx <= kSeed_px; ++dx)
      if (image.contains(pick.pixel + cv::Point(dx, dy))) square.push_back(pick.pixel + cv::Point(dx, dy));
  const dataset::Rgb seed = median(bgr, square);
  const int brightest = *std::max_element(seed.begin(), seed.end());
  PickedRegion region{pick, seed, 0, {}};
  cv::Mat seen(bgr.size(), CV_8U, cv::Scalar(0));
  std::vector<cv::Point> open{pick.pixel};
  seen.at<std::uint8_t>(pick.pixel) = 1;
  while (!open.empty() && region.pixels.size() < kMostPixels) {
    const cv::Point p = open.back();
    open.pop_back();
    const dataset::Rgb rgb = rgbAt(bgr, p);
    // Half the brightness is another surface (a shadowed side, the black gap between two regions).
    if (chromaDistance(rgb, seed) > kRegionChroma ||
        2 * *std::max_element(rgb.begin(), rgb.end()) < brightest)
      continue;
    region.pixels.push_back(p);
    for (const cv::Point& step : {cv::Point(1, 0), {-1, 0}, {0, 1}, {0, -1}}) {
      const cv::Point next = p + step;
      if (!image.contains(next) || seen.at<std::uint8_t>(next) != 0) continue;
      seen.at<std::uint8_t>(next) = 1;
      open.push_back(next);
    }
  }
  if (region.pixels.size() >= kMostPixels)
    throw options::Error(
        fmt::format("{}: the region around pixel {},{} has more than {} pixels: is it the floor?",
                    nameOf(pick), pick.pixel.x, pick.pixel.y, kMostPixels));
  if (region.pixels.size() < kLeastPixels)
    throw options::Error(fmt::format("{}: fewer than {} pixels around {},{} have its colour", nameOf(pick),
                                     kLeastPixels, pick.pixel.x, pick.pixel.y));
  region.rgb = median(bgr, region.pixels);
  region.area_px = static_cast<int>(region.pixels.size());
  return region;
}

void enterColours(const std::vector<PickedRegion>& regions, const FinderOptions& options,
                  dataset::MarkerSet& markers) {
  const bool patches = markers.kind == dataset::MarkerKind::kPatches;
  std::map<std::string, std::vector<std::string>> given;
  for (const PickedRegion& region : regions) {
    const bool of_patches = region.pick.region == "team" || region.pick.region == "individual";
    if (of_patches != patches) {
      throw options::Error(fmt::format("{}: markers of kind {} have no such region", nameOf(region.pick),
                                       patches ? "patches" : "cover_tail_head"));
    }
    colourOf(region.pick, markers) = region.rgb;
    given[region.pick.robot].push_back(region.pick.region);
  }
  if (patches && given.count("") == 0) throw options::Error("--team: pixel of the team patch is missing");
  for (const auto& [robot, unused] : markers.robots) {
    for (const char* needed : {"cover", "tail", "head", "individual"}) {
      if ((std::string(needed) == "individual") != patches) continue;
      const auto& names = given[robot];
      if (std::count(names.begin(), names.end(), needed) == 0)
        throw options::Error(fmt::format("{}: --{} is missing", robot, needed));
    }
  }
  // Nearly equal colours are one colour in several roles. In between, pixels of both would be confused.
  for (std::size_t i = 0; i < regions.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      const double distance = chromaDistance(regions[i].rgb, regions[k].rgb);
      if (distance < 0.5 * options.chroma_tolerance || distance >= options.chroma_tolerance) continue;
      throw options::Error(
          fmt::format("{} and {}: their colours are too near: distance {:.2f}, required {:.2f} or, for equal "
                      "colours, less "
                      "than {:.2f} (chroma_tolerance). Repaint one of them",
                      nameOf(regions[k].pick), nameOf(regions[i].pick), distance, options.chroma_tolerance,
                      0.5 * options.chroma_tolerance));
    }
  }
  const Layout check(markers, {options.chroma_tolerance, options.min_brightness, options.min_saturation});
}

cv::Mat pictureOf(const cv::Mat& bgr, const std::vector<PickedRegion>& regions) {
  constexpr int kFold = 2;
  cv::Mat picture;
  cv::resize(bgr, picture, {}, kFold, kFold, cv::INTER_NEAREST);
  for (const PickedRegion& region : regions) {
    cv::Mat mask(bgr.size(), CV_8U, cv::Scalar(0));
    for (const cv::Point& p : region.pixels) mask.at<std::uint8_t>(p) = 255;
    cv::resize(mask, mask, {}, kFold, kFold, cv::INTER_NEAREST);
    std::vector<std::vector<cv::Point>> outlines;
    cv::findContours(mask, outlines, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
    cv::drawContours(picture, outlines, -1, {255, 255, 255}, 1);
    const cv::Point at = kFold * region.pick.pixel + cv::Point(24, 4);
    cv::line(picture, kFold * region.pick.pixel, at, {255, 255, 255});
    cv::rectangle(picture, at, at + cv::Point(10, -10),
                  cv::Scalar(region.rgb[2], region.rgb[1], region.rgb[0]), cv::FILLED);
    cv::putText(picture, nameOf(region.pick), at + cv::Point(14, 0), cv::FONT_HERSHEY_SIMPLEX, 0.4, {0, 0, 0},
                3);
    cv::putText(picture, nameOf(region.pick), at + cv::Point(14, 0), cv::FONT_HERSHEY_SIMPLEX, 0.4,
                {255, 255, 255}, 1);
  }
  return picture;
}

}  // namespace omnifleet::markers
