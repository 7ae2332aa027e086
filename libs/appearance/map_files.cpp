#include "appearance/map_files.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <charconv>
#include <map>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "appearance/checksum.h"
#include "appearance/stored_signature.h"
#include "dataset/atomic_file.h"

namespace omnifleet::appearance {
namespace {

constexpr char kTitle[] = "# omnifleet topological map 1\n";
constexpr char kSignaturesTitle[] = "omnifleet signatures 1\n";
constexpr char kMapFrame[] = "map";  // written for the empty name of the common frame
constexpr char kGraphSum[] = "graph ", kSignaturesSum[] = "# signatures ", kSum[] = "# sha256 ";
/// Larger numbers of rows or frequencies are damage.
constexpr int kMostPerSignature = 1 << 16;

std::string companionOf(const std::string& path) {
  return path + ".signatures";
}

[[noreturn]] void refuse(const std::string& path, const std::string& problem) {
  throw std::runtime_error(fmt::format("{}: {}; the map is not read", path, problem));
}

/// Links to places of the same robot: the others are in no graph of this robot.
std::vector<const PlaceLink*> linksOf(const SavedMap& map, const Place& place) {
  std::vector<const PlaceLink*> links;
  for (const PlaceLink& link : place.links)
    if (link.robot == map.robot && link.index < map.places.size()) links.push_back(&link);
  return links;
}

/// Vertices and edges, with as many digits as a double needs. A vertex has the number of its image.
std::string graphText(const SavedMap& map) {
  std::string text = kTitle;
  for (const Place& place : map.places) {
    const Pose2& p = place.frame_from_base;
    text += fmt::format("VERTEX_SE2 {} {:.17g} {:.17g} {:.17g}\n", place.sequence, p.x_m, p.y_m, p.theta_rad);
  }
  if (!map.places.empty()) text += fmt::format("FIX {}\n", map.places.front().sequence);
  for (const Place& place : map.places) {
    for (const PlaceLink* of : linksOf(map, place)) {
      const PlaceLink& link = *of;
      const Pose2& p = link.this_from_other;
      const Eigen::Matrix3d i = link.covariance.inverse();
      text += fmt::format(
          "EDGE_SE2 {} {} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g}\n",
          place.sequence, map.places[link.index].sequence, p.x_m, p.y_m, p.theta_rad, i(0, 0), i(0, 1),
          i(0, 2), i(1, 1), i(1, 2), i(2, 2));
    }
  }
  return text;
}

std::string hex(const std::vector<std::uint8_t>& bytes) {
  std::string text;
  text.reserve(2 * bytes.size());
  for (const std::uint8_t byte : bytes) text += fmt::format("{:02x}", byte);
  return text;
}

std::string signaturesText(const SavedMap& map, const std::string& graph_sum) {
  const SignatureFormat& f = map.format;
  std::string text = kSignaturesTitle;
  text += kGraphSum + graph_sum + "\n";
  text += fmt::format("robot {}\nframe {}\ncamera {}\n", map.robot, map.frame.empty() ? kMapFrame : map.frame,
                      f.camera);
  text += fmt::format("scale {} {:.17g} {:.17g}\n", map.scale.metric ? 1 : 0, map.scale.metres,
                      map.scale.sigma_metres);
  text += fmt::format("format {} {} {} {} {} {:.9g} {:.9g}\n", f.rows, f.columns, f.stored_rows,
                      f.stored_modules, f.stored_phases, f.least_elevation_rad, f.most_elevation_rad);
  text += fmt::format("places {}\n", map.places.size());
  for (const Place& place : map.places) {
    text += fmt::format("place {} {} {}", place.index, place.acquired_ns, place.sequence);
    for (int k = 0; k < 9; ++k) text += fmt::format(" {:.17g}", place.covariance(k / 3, k % 3));
    const std::vector<const PlaceLink*> links = linksOf(map, place);
    text += fmt::format(" {}", links.size());
    for (const PlaceLink* link : links) text += link->closes_loop ? " loop" : " step";
    if (place.signature.bytes.empty()) {
      text += " unsigned\n";
      continue;
    }
    text += " signature";
    for (const float scale : place.signature.scale) text += fmt::format(" {:.9g}", scale);
    text += " " + hex(place.signature.bytes) + "\n";
  }
  return text;
}

/// Content before the line that begins with `key` at the end of `text`, and the rest of that line. Refuses
/// files without it.
std::pair<std::string, std::string> splitLastLine(const std::string& path, const std::string& text,
                                                  const std::string& key) {
  if (text.empty() || text.back() != '\n')
    refuse(path, "the file is cut short (its last line is incomplete)");
  const std::size_t before = text.find_last_of('\n', text.size() - 2),
                    begin = before == std::string::npos ? 0 : before + 1;
  const std::string line = text.substr(begin, text.size() - begin - 1);
  if (line.compare(0, key.size(), key) != 0)
    refuse(path, "the file is cut short (it has no checksum at its end)");
  return {text.substr(0, begin), line.substr(key.size())};
}

/// Content without its checksum. Refuses altered files.
std::string checkedContent(const std::string& path) {
  const auto [content, sum] = splitLastLine(path, dataset::readFile(path), kSum);
  if (sum != checksum(content)) refuse(path, "the file is altered (its checksum does not match)");
  return content;
}

/// Reads the fields of one file in order. Every failure refuses the file.
class Fields {
 public:
  Fields(std::string path, const std::string& text) : path_(std::move(path)), in_(text) {}

  void expect(const std::string& word) {
    std::string got;
    if (!(in_ >> got) || got != word) refuse(path_, "expected \"" + word + "\", found \"" + got + "\"");
  }
  template <typename T>
  T take() {
    T value{};
    if (!(in_ >> value)) refuse(path_, "a value is missing or malformed");
    return value;
  }
  int count(int most) {
    const auto value = take<long long>();
    if (value < 0 || value > most) refuse(path_, fmt::format("{} is no valid count", value));
    return static_cast<int>(value);
  }
  /// May be empty.
  std::string restOfLine() {
    std::string text;
    if (in_.peek() == ' ') in_.get();
    std::getline(in_, text);
    return text;
  }
  bool atEnd() { return (in_ >> std::ws).eof(); }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
  std::istringstream in_;
};

std::vector<std::uint8_t> bytesFromHex(Fields& fields, std::size_t count) {
  const auto text = fields.take<std::string>();
  if (text.size() != 2 * count) refuse(fields.path(), "a signature has another length than its format");
  std::vector<std::uint8_t> bytes(count);
  for (std::size_t i = 0; i < count; ++i) {
    const char* const begin = text.data() + 2 * i;
    if (std::from_chars(begin, begin + 2, bytes[i], 16).ptr != begin + 2)
      refuse(fields.path(), "a signature is malformed");
  }
  return bytes;
}

void readHeader(Fields& fields, SavedMap& map) {
  fields.expect("robot");
  map.robot = fields.restOfLine();
  fields.expect("frame");
  map.frame = fields.restOfLine();
  if (map.frame == kMapFrame) map.frame.clear();
  fields.expect("camera");
  map.format.camera = fields.restOfLine();
  fields.expect("scale");
  map.scale.metric = fields.take<int>() != 0;
  map.scale.metres = fields.take<double>();
  map.scale.sigma_metres = fields.take<double>();
  fields.expect("format");
  for (std::uint16_t* value : {&map.format.rows, &map.format.columns, &map.format.stored_rows,
                               &map.format.stored_modules, &map.format.stored_phases})
    *value = static_cast<std::uint16_t>(fields.count(kMostPerSignature - 1));
  map.format.least_elevation_rad = fields.take<float>();
  map.format.most_elevation_rad = fields.take<float>();
}

void readPlaces(Fields& fields, SavedMap& map) {
  const SignatureFormat& format = map.format;
  fields.expect("places");
  const auto places = fields.take<std::size_t>();
  for (std::size_t i = 0; i < places; ++i) {
    Place place;
    fields.expect("place");
    place.robot = map.robot;
    place.frame = map.frame;
    place.metric = map.scale.metric;
    place.format = format;
    place.index = fields.take<std::uint32_t>();
    if (place.index != i) refuse(fields.path(), "the places are not in order");
    place.acquired_ns = fields.take<TimeNs>();
    place.sequence = fields.take<std::uint32_t>();
    for (int k = 0; k < 9; ++k) place.covariance(k / 3, k % 3) = fields.take<double>();
    place.links.resize(static_cast<std::size_t>(fields.count(kMostPerSignature)));
    for (PlaceLink& link : place.links) link.closes_loop = fields.take<std::string>() == "loop";
    const auto has = fields.take<std::string>();
    if (has != "signature" && has != "unsigned") refuse(fields.path(), "a signature is malformed");
    if (has == "unsigned") {
      map.places.push_back(std::move(place));
      continue;
    }
    for (int row = 0; row < format.stored_rows; ++row) place.signature.scale.push_back(fields.take<float>());
    place.signature.bytes = bytesFromHex(
        fields, format.stored_rows * (std::size_t{format.stored_modules} + format.stored_phases));
    if (const std::string reason = whyMalformed(format, place.signature); !reason.empty())
      refuse(fields.path(), reason);
    map.places.push_back(std::move(place));
  }
  if (!fields.atEnd()) refuse(fields.path(), "there is more after the last place");
}

Pose2 takePose(Fields& fields) {
  Pose2 pose;
  pose.x_m = fields.take<double>();
  pose.y_m = fields.take<double>();
  pose.theta_rad = fields.take<double>();
  return pose;
}

void readGraph(Fields& fields, SavedMap& map) {
  fields.restOfLine();  // the title
  for (Place& place : map.places) {
    fields.expect("VERTEX_SE2");
    if (fields.take<std::uint32_t>() != place.sequence)
      refuse(fields.path(), "the vertices are not those of the places");
    place.frame_from_base = takePose(fields);
  }
  std::map<std::uint32_t, std::uint32_t> index_of;  // by the number of the image
  for (const Place& place : map.places) index_of[place.sequence] = place.index;
  if (index_of.size() != map.places.size()) refuse(fields.path(), "two places are of one image");
  if (!map.places.empty()) {
    fields.expect("FIX");
    fields.expect(std::to_string(map.places.front().sequence));
  }
  for (Place& place : map.places) {
    for (PlaceLink& link : place.links) {
      fields.expect("EDGE_SE2");
      if (fields.take<std::uint32_t>() != place.sequence)
        refuse(fields.path(), "the edges are not those of the places");
      const auto other = index_of.find(fields.take<std::uint32_t>());
      if (other == index_of.end()) refuse(fields.path(), "an edge ends at an unknown place");
      link.index = other->second;
      link.robot = map.robot;
      link.this_from_other = takePose(fields);
      Eigen::Matrix3d information;
      for (int row = 0; row < 3; ++row) {
        for (int column = row; column < 3; ++column)
          information(row, column) = information(column, row) = fields.take<double>();
      }
      link.covariance = information.inverse();
    }
  }
  if (!fields.atEnd()) refuse(fields.path(), "there are more vertices or edges than places and links");
}

}  // namespace

SavedMap contentOf(const TopologicalMap& map) {
  return {map.robot(), map.frame(), map.scale(), map.format(), map.places()};
}

void saveMap(const std::string& path, const SavedMap& map) {
  const std::string graph = graphText(map);
  std::string signatures = signaturesText(map, checksum(graph));
  signatures += kSum + checksum(signatures) + "\n";
  std::string text = graph + kSignaturesSum + checksum(signatures) + "\n";
  text += kSum + checksum(text) + "\n";
  dataset::writeAtomic(companionOf(path), signatures);
  dataset::writeAtomic(path, text);
}

SavedMap loadMap(const std::string& path) {
  const std::string companion = companionOf(path);
  const auto [graph, signatures_sum] = splitLastLine(path, checkedContent(path), kSignaturesSum);
  const std::string content = checkedContent(companion);
  if (checksum(dataset::readFile(companion)) != signatures_sum)
    refuse(path, companion + " belongs to another map (its checksum is not the one recorded here)");
  Fields fields(companion, content);
  if (fields.restOfLine() + "\n" != kSignaturesTitle)
    refuse(companion, "this is no file of signatures, version 1");
  fields.expect("graph");
  if (fields.take<std::string>() != checksum(graph)) refuse(companion, "the file belongs to another graph");
  SavedMap map;
  readHeader(fields, map);
  readPlaces(fields, map);
  if (graph.compare(0, sizeof kTitle - 1, kTitle) != 0) refuse(path, "this is no topological map, version 1");
  Fields edges(path, graph);
  readGraph(edges, map);
  return map;
}

}  // namespace omnifleet::appearance
