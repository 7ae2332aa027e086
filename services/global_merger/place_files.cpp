#include "global_merger/place_files.h"

#include <exception>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <utility>

#include "appearance/map_files.h"
#include "dataset/atomic_file.h"

namespace omnifleet::global_merger {
namespace {

namespace fs = std::filesystem;

/// Numbered without gaps: live, samples may be lost.
appearance::SavedMap contentOf(const std::map<std::uint32_t, Place>& places) {
  appearance::SavedMap map;
  const Place& first = places.begin()->second;
  map.robot = first.robot;
  map.frame = places.rbegin()->second.frame;
  map.format = first.format;
  map.scale.metric = first.metric;
  std::map<std::uint32_t, std::uint32_t> index_of;
  for (const auto& [index, place] : places) {
    if (place.frame != map.frame || place.format != map.format) continue;
    index_of[index] = static_cast<std::uint32_t>(map.places.size());
    map.places.push_back(place);
    map.places.back().index = index_of[index];
    map.scale.metric = map.scale.metric && place.metric;
  }
  for (Place& place : map.places) {
    std::vector<PlaceLink> links;
    for (PlaceLink link : place.links) {
      const auto other = index_of.find(link.index);
      if (link.robot != map.robot || other == index_of.end()) continue;
      link.index = other->second;
      links.push_back(std::move(link));
    }
    place.links = std::move(links);
  }
  return map;
}

}  // namespace

std::vector<std::string> PlaceFiles::save(const std::string& out) const {
  std::vector<std::string> problems;
  for (const auto& [robot, places] : places_) {
    const appearance::SavedMap map = contentOf(places);
    const std::string own = out + "/maps/" + robot + "/places";
    const std::string folder = map.frame.empty() ? out + "/places" : own;
    remove(robot, map.frame.empty() ? own : out + "/places");
    try {
      dataset::makeDirectories(folder);
      appearance::saveMap(folder + "/" + robot + ".g2o", map);
      std::vector<unsigned char> png;
      cv::imencode(".png", appearance::drawMap(map.places), png);
      dataset::writeAtomic(folder + "/" + robot + ".png", std::string(png.begin(), png.end()));
    } catch (const std::exception& problem) {
      problems.emplace_back(problem.what());
    }
  }
  return problems;
}

void PlaceFiles::remove(const std::string& robot, const std::string& folder) {
  std::error_code ignored;
  for (const char* extension : {".g2o", ".g2o.signatures", ".png"})
    fs::remove(fs::path(folder) / (robot + extension), ignored);
  if (fs::is_directory(folder, ignored)) fs::remove(folder, ignored);
}

}  // namespace omnifleet::global_merger
