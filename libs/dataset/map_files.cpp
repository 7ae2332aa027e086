#include "dataset/map_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>

#include "dataset/atomic_file.h"
#include "options/options.h"

namespace omnifleet::dataset {
namespace {

using Json = nlohmann::ordered_json;

/// Rounds to 1 µm, without a negative zero.
double rounded(double value) {
  return std::round(value * 1e6) / 1e6 + 0.0;
}
Json point(const Eigen::Vector2d& p) {
  return Json::array({rounded(p.x()), rounded(p.y())});
}

Json geometryOf(const MapObject& object) {
  Json points = Json::array();
  Polygon outline = object.outline_m;
  if (!object.isOpen() && signedArea(outline) < 0.0) std::reverse(outline.begin(), outline.end());
  for (const Eigen::Vector2d& vertex : outline) points.push_back(point(vertex));
  if (object.isOpen()) return {{"type", "LineString"}, {"coordinates", points}};
  if (!outline.empty()) points.push_back(point(outline.front()));
  return {{"type", "Polygon"}, {"coordinates", Json::array({points})}};
}

/// Rounds to 0.01 mm².
Json covariance(const Eigen::Matrix2d& m2) {
  Json rows = Json::array();
  for (int i = 0; i < 4; ++i) rows.push_back(std::round(m2(i / 2, i % 2) * 1e8) / 1e8 + 0.0);
  return rows;
}

Json feature(const RejectedPlace& place) {
  Json result;
  result["type"] = "Feature";
  result["properties"] = {
      {"kind", "rejected"}, {"reason", place.reason}, {"observations", place.observations}};
  result["geometry"] = {{"type", "Point"}, {"coordinates", point(place.at_m)}};
  return result;
}

Json feature(const MapObject& object) {
  Json properties;
  properties["id"] = object.id;
  properties["kind"] = object.kind;
  if (!object.name.empty()) properties["name"] = object.name;
  properties["centroid"] = point(object.centroid_m);
  properties["observations"] = object.observations;
  properties["observers"] = object.observers;
  if (object.height_m > 0.0) properties["height_m"] = rounded(object.height_m);
  if (!object.covariance_m2.isZero()) properties["covariance_m2"] = covariance(object.covariance_m2);
  if (!object.quality.empty()) properties["quality"] = object.quality;
  Json result;
  result["type"] = "Feature";
  result["properties"] = properties;
  result["geometry"] = geometryOf(object);
  return result;
}

constexpr unsigned char kOccupied = 0, kFree = 254, kUnknown = 205;  // values that map_server writes

unsigned char grey(std::int8_t cell) {
  if (cell < 0) return kUnknown;
  if (cell <= 25) return kFree;
  return cell >= 65 ? kOccupied : kUnknown;
}

struct Pgm {
  int width = 0, height = 0, maximum = 255;
  std::string pixels;
};

/// Reads a whole number of the header and skips blanks and comments before it.
int headerNumber(std::istream& in) {
  int value = -1;
  while (in >> std::ws && in.peek() == '#') in.ignore(1 << 16, '\n');
  in >> value;
  return value;
}

Pgm readPgm(const std::string& path) {
  std::istringstream in(readFile(path));
  std::string magic;
  in >> magic;
  if (magic != "P5") throw std::runtime_error(path + ": is not a binary PGM (P5)");
  Pgm image;
  image.width = headerNumber(in);
  image.height = headerNumber(in);
  image.maximum = headerNumber(in);
  const bool sane = image.width > 0 && image.height > 0 && image.width < (1 << 20) &&
                    image.height < (1 << 20) && image.maximum > 0 && image.maximum < 256;
  if (!sane) throw std::runtime_error(path + ": the PGM header is damaged");
  in.get();
  const std::size_t size = static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
  const std::string all = in.str();
  const auto start = static_cast<std::size_t>(in.tellg());
  if (all.size() < start + size) throw std::runtime_error(path + ": the PGM is truncated");
  image.pixels = all.substr(start, size);
  return image;
}

}  // namespace

double MapObject::distanceTo(const Eigen::Vector2d& at_m) const {
  if (!isOpen()) return omnifleet::distanceTo(outline_m, at_m);
  double nearest_m = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i + 1 < outline_m.size(); ++i) {
    const Eigen::Vector2d along = outline_m[i + 1] - outline_m[i], to = at_m - outline_m[i];
    const double share = std::clamp(to.dot(along) / std::max(along.squaredNorm(), 1e-18), 0.0, 1.0);
    nearest_m = std::min(nearest_m, (to - share * along).norm());
  }
  return nearest_m;
}

std::string objectsText(const std::vector<MapObject>& objects, const std::vector<RejectedPlace>& rejected,
                        const std::string& frame) {
  std::string text = "{\"type\": \"FeatureCollection\", ";
  if (!frame.empty()) text += "\"frame\": " + Json(frame).dump() + ", ";
  text += "\"features\": [";
  bool any = false;
  const auto add = [&](const Json& one) {
    text += any ? ",\n" : "\n";
    text += one.dump();
    any = true;
  };
  for (const MapObject& object : objects) add(feature(object));
  for (const RejectedPlace& place : rejected) add(feature(place));
  return text + "\n]}\n";
}

void writeObjects(const std::string& path, const std::vector<MapObject>& objects,
                  const std::vector<RejectedPlace>& rejected, const std::string& frame) {
  writeAtomic(path, objectsText(objects, rejected, frame));
}

void writeMapServer(const std::string& stem, const OccupancyGrid& grid, const std::string& frame) {
  const auto width = static_cast<std::size_t>(grid.width), height = static_cast<std::size_t>(grid.height);
  if (grid.width <= 0 || grid.height <= 0 || grid.cells.size() != width * height) {
    throw std::invalid_argument(fmt::format("writeMapServer: {} cells for a grid of {}×{}", grid.cells.size(),
                                            grid.width, grid.height));
  }
  std::string image = fmt::format("P5\n{} {}\n255\n", width, height);
  image.reserve(image.size() + grid.cells.size());
  for (std::size_t y = height; y-- > 0;) {  // the first row of the image is the last row of the map
    for (std::size_t x = 0; x < width; ++x) image += static_cast<char>(grey(grid.cells[x + y * width]));
  }
  writeAtomic(stem + ".pgm", image);
  writeAtomic(
      stem + ".yaml",
      fmt::format("image: {}.pgm\nresolution: {}\norigin: [{}, {}, 0]\nnegate: 0\noccupied_thresh: 0.65\n"
                  "free_thresh: 0.196\n{}",
                  std::filesystem::path(stem).filename().string(), grid.resolution_m,
                  rounded(grid.origin_m.x()), rounded(grid.origin_m.y()),
                  frame.empty() ? "" : fmt::format("frame: {}\n", Json(frame).dump())));
}

OccupancyGrid readMapServer(const std::string& yaml_path) {
  const options::Section section = options::Section::load(yaml_path);
  OccupancyGrid grid;
  std::string image, mode = "trinary", frame;
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  int negate = 0;
  double occupied = 0.65, free = 0.196;
  section.require("image", image);
  section.require("resolution", grid.resolution_m, options::kPositive);
  section.require("origin", origin);
  section.read("negate", negate, {0, 1});
  section.read("occupied_thresh", occupied, {0.0, 1.0});
  section.read("free_thresh", free, {0.0, 1.0});
  section.read("mode", mode);
  section.read("frame", frame);
  section.finish();
  const Pgm pgm = readPgm((std::filesystem::path(yaml_path).parent_path() / image).string());
  grid.width = pgm.width;
  grid.height = pgm.height;
  grid.origin_m = origin.head<2>();
  const auto width = static_cast<std::size_t>(pgm.width);
  for (std::size_t y = static_cast<std::size_t>(pgm.height); y-- > 0;) {
    for (std::size_t x = 0; x < width; ++x) {
      const double brightness =
          static_cast<unsigned char>(pgm.pixels[x + y * width]) / static_cast<double>(pgm.maximum);
      const double p = negate ? brightness : 1.0 - brightness;
      grid.cells.push_back(p > occupied ? 100 : p < free ? 0 : -1);
    }
  }
  return grid;
}

}  // namespace omnifleet::dataset
