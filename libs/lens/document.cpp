#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <fstream>
#include <iterator>
#include <opencv2/core.hpp>
#include <opencv2/core/persistence.hpp>

#include "lens/foreign.h"

namespace omnifleet::lens {
namespace {

YAML::Node nodeFromXml(const cv::FileNode& node) {
  if (node.isMap()) {
    YAML::Node map(YAML::NodeType::Map);
    for (const cv::FileNode& child : node) {
      if (child.name() != "type_id") map[child.name()] = nodeFromXml(child);
    }
    return map;
  }
  if (node.isSeq()) {
    YAML::Node list(YAML::NodeType::Sequence);
    for (const cv::FileNode& child : node) list.push_back(nodeFromXml(child));
    return list;
  }
  if (node.isInt()) return YAML::Node(static_cast<int>(node));
  if (node.isReal()) return YAML::Node(fmt::format("{:.17g}", node.real()));
  return node.isString() ? YAML::Node(node.string()) : YAML::Node();
}

/// Removes what OpenCV does not read in front of the root element: comments above the XML declaration. Adds
/// the declaration if it is missing.
std::string withXmlDeclaration(std::string text) {
  while (text.rfind("<!--", 0) == 0) {
    const std::size_t end = text.find("-->");
    const std::size_t next = end == std::string::npos ? end : text.find('<', end);
    if (next == std::string::npos) return text;
    text.erase(0, next);
  }
  return text.rfind("<?xml", 0) == 0 ? text : "<?xml version=\"1.0\"?>\n" + text;
}

YAML::Node loadXml(const std::string& path, const std::string& text) {
  try {
    const cv::FileStorage file(text, cv::FileStorage::READ | cv::FileStorage::MEMORY);
    if (file.isOpened()) return nodeFromXml(file.root());
  } catch (const cv::Exception&) {
  }
  throw options::Error(fmt::format(
      "{}: this XML file is not an OpenCV FileStorage; write its numbers into a sensor.yaml (focal_px, "
      "principal_point_px, distortion, projection)",
      path));
}

/// The document of a YAML file. Throws options::Error if another one with content follows a map. Texts
/// without keys (OCamCalib) are no YAML, and their comments would end a document.
YAML::Node onlyDocument(const std::string& path, const std::vector<YAML::Node>& documents) {
  YAML::Node only;
  bool has_content = false;
  for (const YAML::Node& one : documents) {
    if (!one.IsDefined() || one.IsNull()) continue;
    if (has_content && !only.IsMap()) break;
    if (has_content) {
      const std::string key =
          one.IsMap() && one.size() > 0 && one.begin()->first.IsScalar() ? one.begin()->first.Scalar() : "";
      throw options::Error(
          fmt::format("{}:{}: {}a second YAML document begins here (`---`), and only one can be meant; "
                      "delete it, or move "
                      "its keys into the first one",
                      path, one.Mark().line + 1, key.empty() ? "" : key + ": "));
    }
    only.reset(one);
    has_content = true;
  }
  return only;
}

/// NaN or infinity in the spelling of YAML, OpenCV, Python or JSON.
bool isNonFinite(const YAML::Node& node) {
  if (!node.IsScalar()) return false;
  std::string text = normalized(node.Scalar());
  text.erase(0, text.find_first_not_of(".+"));
  return text == "nan" || text == "inf" || text == "infinity";
}

struct NonFinite {
  std::size_t index;  ///< of the value, from 1
  std::string text;
};

void collectNumbers(const YAML::Node& node, std::vector<double>& values) {
  if (node.IsSequence()) {
    for (const YAML::Node& item : node) collectNumbers(item, values);
    return;
  }
  if (isNonFinite(node)) throw NonFinite{values.size() + 1, node.Scalar()};
  values.push_back(node.as<double>());
}

}  // namespace

std::string Document::place(const YAML::Node& node) const {
  const YAML::Mark mark = node.Mark();
  return mark.is_null() ? path : fmt::format("{}:{}", path, mark.line + 1);
}

Document readDocument(const std::string& path) {
  Document document;
  document.path = path;
  std::ifstream file(path);
  document.text = {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  if (document.text.empty()) options::Section::load(path);  // throws the reason, unless the file is empty
  if (document.text.rfind("\xEF\xBB\xBF", 0) == 0) document.text.erase(0, 3);
  const std::size_t first = document.text.find_first_not_of(" \t\r\n");
  const char begin = first == std::string::npos ? '\0' : document.text[first];
  if (begin == '<') {
    document.root = loadXml(path, withXmlDeclaration(document.text.substr(first)));
    return document;
  }
  try {
    document.root = onlyDocument(path, YAML::LoadAll(document.text));
  } catch (const YAML::Exception& error) {
    document.yaml_error = fmt::format("{}: not valid YAML: {}", error.mark.line + 1, error.msg);
  }
  return document;
}

std::vector<double> numbersOf(const Document& document, const YAML::Node& node, const std::string& key) {
  std::vector<double> values;
  const YAML::Node data = node.IsMap() ? node["data"] : node;
  try {
    if (!data.IsDefined() || !data.IsSequence()) throw YAML::BadConversion(node.Mark());
    collectNumbers(data, values);
  } catch (const NonFinite& value) {
    throw options::Error(
        fmt::format("{}: {}: value {} is {}, but every number must be finite; calibrate again",
                    document.place(node), key, value.index, value.text));
  } catch (const YAML::Exception&) {
    throw options::Error(fmt::format("{}: {}: expected a list of numbers", document.place(node), key));
  }
  if (!node.IsMap() || !node["rows"] || !node["cols"]) return values;
  const auto rows = node["rows"].as<double>(0.0), cols = node["cols"].as<double>(0.0);
  if (rows * cols != static_cast<double>(values.size()))
    throw options::Error(fmt::format("{}: {}: has {} numbers in `data`, but {:g} rows and {:g} columns",
                                     document.place(node), key, values.size(), rows, cols));
  return values;
}

void rejectRepeatedKeys(const Document& document, const YAML::Node& node) {
  std::vector<std::string> seen;
  for (const auto& entry : node) {
    if (node.IsMap() && entry.second.IsMap()) rejectRepeatedKeys(document, entry.second);
    if (!node.IsMap() || !entry.first.IsScalar()) continue;
    const std::string& key = entry.first.Scalar();
    if (std::find(seen.begin(), seen.end(), key) != seen.end())
      throw options::Error(
          fmt::format("{}: {}: duplicate key; keep one of them", document.place(entry.first), key));
    seen.push_back(key);
  }
}

std::string textOf(const Document& document, const YAML::Node& node, const std::string& key) {
  if (!node.IsScalar())
    throw options::Error(fmt::format("{}: {}: expected text or a number", document.place(node), key));
  return node.Scalar();
}

std::string normalized(const std::string& key) {
  std::string text;
  for (const char c : key) {
    if (c != '_' && c != '-' && c != ' ')
      text += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return text;
}

}  // namespace omnifleet::lens
