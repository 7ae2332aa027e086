// Reading of objects.geojson and scene.geojson, also as GIS programs save them.
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "dataset/atomic_file.h"
#include "dataset/map_files.h"

namespace omnifleet::dataset {
namespace {

using GeoJson = nlohmann::ordered_json;

/// One feature. Each problem names its key and what was expected, without the JSON library's words.
class FeatureReader {
 public:
  FeatureReader(const GeoJson& json, std::size_t index) : json_(json), index_(index) {
    if (!json.is_object()) fail("feature", "an object", json);
  }

  /// Adds one object per outer ring. Returns why the feature was passed over; empty if it was used.
  std::string read(std::vector<MapObject>& objects) const {
    MapObject object = readProperties();
    const GeoJson* geometry = member(json_, "geometry");
    if (!geometry) return "has no geometry";
    if (!geometry->is_object()) fail("geometry", "an object", *geometry);
    const GeoJson* type = member(*geometry, "type");
    if (!type || !type->is_string()) fail("geometry.type", "text", type ? *type : GeoJson());
    const std::string name = *type;
    if (name == "LineString" && object.isOpen()) {
      object.outline_m = points(coordinates(*geometry));
      object.centroid_m = givenCentroid().value_or(object.centroid_m);
      objects.push_back(object);
      return {};
    }
    if (name == "Polygon" || name == "MultiPolygon") {
      addPolygons(object,
                  name == "Polygon" ? GeoJson::array({coordinates(*geometry)}) : coordinates(*geometry),
                  objects);
      return {};
    }
    if (name == "LineString" || name == "MultiLineString")
      return addLines(
          object, name == "LineString" ? GeoJson::array({coordinates(*geometry)}) : coordinates(*geometry),
          objects);
    return object.kind == "rejected" ? "" : fmt::format("a {} has no area", name);
  }

 private:
  [[noreturn]] static void fail(const std::string& key, const std::string& expected, const GeoJson& found) {
    throw std::runtime_error(fmt::format("{}: expected {}, found {}", key, expected,
                                         found.is_null() ? "nothing" : found.type_name()));
  }

  /// Null if the member is absent or null.
  static const GeoJson* member(const GeoJson& json, const char* key) {
    if (!json.is_object()) return nullptr;
    const auto found = json.find(key);
    return found == json.end() || found->is_null() ? nullptr : &*found;
  }
  const GeoJson* property(const char* key) const {
    const GeoJson* properties = member(json_, "properties");
    return properties ? member(*properties, key) : nullptr;
  }

  MapObject readProperties() const {
    MapObject object;
    object.id = index_;
    const GeoJson* properties = member(json_, "properties");
    if (properties && !properties->is_object()) fail("properties", "an object", *properties);
    if (const GeoJson* id = property("id"); id && id->is_number_integer())
      object.id = id->get<std::uint64_t>();
    if (const GeoJson* kind = property("kind")) object.kind = text("properties.kind", *kind);
    if (const GeoJson* name = property("name"))
      object.name = name->is_number_integer() ? name->dump() : text("properties.name", *name);
    if (const GeoJson* count = property("observations")) {
      if (!count->is_number_integer()) fail("properties.observations", "a whole number", *count);
      object.observations = count->get<int>();
    }
    if (const GeoJson* observers = property("observers")) {
      if (!observers->is_array()) fail("properties.observers", "a list of names", *observers);
      for (const GeoJson& one : *observers) object.observers.push_back(text("properties.observers", one));
    }
    if (const GeoJson* height = property("height_m"))
      object.height_m = number("properties.height_m", *height);
    return object;
  }

  std::optional<Eigen::Vector2d> givenCentroid() const {
    const GeoJson* centroid = property("centroid");
    if (!centroid) return std::nullopt;
    return pointOf("properties.centroid", *centroid);
  }

  static std::string text(const std::string& key, const GeoJson& json) {
    if (!json.is_string()) fail(key, "text", json);
    return json;
  }
  static double number(const std::string& key, const GeoJson& json) {
    if (!json.is_number()) fail(key, "a number", json);
    return json.get<double>();
  }
  static Eigen::Vector2d pointOf(const std::string& key, const GeoJson& json) {
    if (!json.is_array() || json.size() < 2) fail(key, "[x, y]", json);
    return {number(key, json[0]), number(key, json[1])};
  }

  static const GeoJson& coordinates(const GeoJson& geometry) {
    const GeoJson* found = member(geometry, "coordinates");
    if (!found || !found->is_array()) fail("geometry.coordinates", "a list", found ? *found : GeoJson());
    return *found;
  }
  static Polygon points(const GeoJson& list) {
    if (!list.is_array()) fail("geometry.coordinates", "a list of points [x, y]", list);
    Polygon polygon;
    for (const GeoJson& one : list) {
      polygon.push_back(pointOf("geometry.coordinates", one));
      if (!polygon.back().allFinite()) throw std::runtime_error("coordinates must be finite numbers");
    }
    return polygon;
  }

  static Polygon ring(Polygon polygon) {
    if (polygon.size() > 1 && polygon.front() == polygon.back()) polygon.pop_back();
    if (polygon.size() < 3) throw std::runtime_error("a ring needs at least 3 different vertices");
    if (signedArea(polygon) < 0.0) std::reverse(polygon.begin(), polygon.end());
    return polygon;
  }

  void add(MapObject object, Polygon outline, bool alone, std::vector<MapObject>& objects) const {
    object.outline_m = ring(std::move(outline));
    object.centroid_m = centroid(object.outline_m);
    if (alone) object.centroid_m = givenCentroid().value_or(object.centroid_m);
    objects.push_back(std::move(object));
  }
  void addPolygons(const MapObject& object, const GeoJson& polygons, std::vector<MapObject>& objects) const {
    for (const GeoJson& polygon : polygons) {
      if (!polygon.is_array() || polygon.empty()) fail("geometry.coordinates", "a list of rings", polygon);
      add(object, points(polygon[0]), polygons.size() == 1, objects);
    }
  }

  /// A closed line is the outline of an object.
  std::string addLines(const MapObject& object, const GeoJson& lines, std::vector<MapObject>& objects) const {
    std::string open;
    for (const GeoJson& line : lines) {
      const Polygon outline = points(line);
      if (outline.size() > 3 && outline.front() == outline.back())
        add(object, outline, lines.size() == 1, objects);
      else
        open = "a line that is not closed has no area; draw a polygon, or give it the kind structure";
    }
    return open;
  }

  const GeoJson& json_;
  std::size_t index_;
};

GeoJson parsed(const std::string& path) {
  const std::string text = readFile(path);
  try {
    return GeoJson::parse(text);
  } catch (const GeoJson::parse_error& error) {
    const std::size_t at = std::min(error.byte, text.size());
    const auto line = 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n');
    throw std::runtime_error(
        fmt::format("{}:{}: not valid JSON; the file may be cut off or damaged", path, line));
  }
}

}  // namespace

std::vector<MapObject> readObjects(const std::string& path, std::vector<std::string>* passed_over) {
  const GeoJson json = parsed(path);
  const auto type = json.is_object() ? json.find("type") : json.end();
  if (!json.is_object() || type == json.end() || *type != "FeatureCollection")
    throw std::runtime_error(path + ": is not a GeoJSON FeatureCollection");
  const auto features = json.find("features");
  if (features == json.end() || !features->is_array())
    throw std::runtime_error(path + ": features: expected a list of features");
  std::vector<MapObject> objects;
  std::size_t index = 0;
  for (const GeoJson& one : *features) {
    try {
      const std::string why = FeatureReader(one, index).read(objects);
      if (!why.empty() && passed_over)
        passed_over->push_back(fmt::format("{}: feature {}: {} (feature ignored)", path, index + 1, why));
    } catch (const std::runtime_error& error) {
      throw std::runtime_error(fmt::format("{}: feature {}: {}", path, index + 1, error.what()));
    }
    ++index;
  }
  return objects;
}

}  // namespace omnifleet::dataset
