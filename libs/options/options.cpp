#include "options/options.h"

#include <fmt/format.h>

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>
#include <system_error>

namespace omnifleet::options {
namespace {

std::string place(const YAML::Node& node, const std::string& file) {
  const YAML::Mark mark = node.Mark();
  return mark.is_null() ? file : fmt::format("{}:{}", file, mark.line + 1);
}

/// YAML 1.2 (3.2.1.1) requires unique keys. yaml-cpp keeps both and returns the first.
void rejectDuplicateKeys(const YAML::Node& node, const std::string& file) {
  if (!node.IsMap() && !node.IsSequence()) return;
  std::map<std::string, int> line_of;
  for (const auto& entry : node) {
    if (!node.IsMap()) {
      rejectDuplicateKeys(entry, file);
      continue;
    }
    rejectDuplicateKeys(entry.second, file);
    if (!entry.first.IsScalar()) continue;
    const auto [first, fresh] = line_of.emplace(entry.first.Scalar(), entry.first.Mark().line + 1);
    if (!fresh) {
      throw Error(fmt::format("{}: {}: duplicate key (first in line {}); keep one of them",
                              place(entry.first, file), first->first, first->second));
    }
  }
}

YAML::Node loadMapping(const YAML::Node& node, const std::string& file) {
  if (node.IsNull() || !node.IsDefined()) return YAML::Node(YAML::NodeType::Map);
  if (!node.IsMap()) throw Error(fmt::format("{}: expected a mapping (key: value)", place(node, file)));
  return node;
}

/// The value of a key. Its mark gives the line of the value, which error messages report.
YAML::Node lookUp(const YAML::Node& node, const std::string& key) {
  for (const auto& entry : node) {
    if (entry.first.IsScalar() && entry.first.Scalar() == key) return entry.second;
  }
  return YAML::Node(YAML::NodeType::Undefined);
}

/// Why a file cannot be read, in the words of the operating system.
std::string readProblem(const std::string& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) return std::strerror(EISDIR);
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return std::strerror(errno);
  ::close(file);
  return "read error";
}

std::string shown(double value) {
  return fmt::format("{:g}", value);
}

std::string shown(Range range) {
  if (range.min == kPositive.min && std::isinf(range.max)) return "must be positive";
  if (std::isinf(range.max)) return fmt::format("must be at least {}", shown(range.min));
  if (std::isinf(range.min)) return fmt::format("must be at most {}", shown(range.max));
  return fmt::format("must be within [{}, {}]", shown(range.min), shown(range.max));
}

}  // namespace

Section Section::load(const std::string& path) {
  Section section;
  try {
    std::error_code ignored;
    if (std::filesystem::is_directory(path, ignored)) throw YAML::BadFile(path);
    section.layers_.push_back({loadMapping(YAML::LoadFile(path), path), path});
    rejectDuplicateKeys(section.layers_.back().node, path);
  } catch (const YAML::BadFile&) {
    throw Error(fmt::format("{}: cannot be read: {}", path, readProblem(path)));
  } catch (const YAML::ParserException& error) {
    throw Error(fmt::format("{}:{}: not valid YAML: {}", path, error.mark.line + 1, error.msg));
  }
  return section;
}

Section Section::parse(const std::string& text, const std::string& name) {
  Section section;
  try {
    section.layers_.push_back({loadMapping(YAML::Load(text), name), name});
    rejectDuplicateKeys(section.layers_.back().node, name);
  } catch (const YAML::ParserException& error) {
    throw Error(fmt::format("{}:{}: not valid YAML: {}", name, error.mark.line + 1, error.msg));
  }
  return section;
}

void Section::overlay(const Section& top) {
  if (layers_.empty()) path_ = top.path_;
  layers_.insert(layers_.end(), top.layers_.begin(), top.layers_.end());
}

std::string Section::name(const std::string& key) const {
  return path_.empty() ? key : path_ + "." + key;
}

const Section::Layer* Section::find(const std::string& key) const {
  for (auto layer = layers_.rbegin(); layer != layers_.rend(); ++layer) {
    if (lookUp(layer->node, key).IsDefined()) return &*layer;
  }
  return nullptr;
}

YAML::Node Section::get(const std::string& key) const {
  known_->insert(key);
  const Layer* layer = find(key);
  return layer ? lookUp(layer->node, key) : YAML::Node(YAML::NodeType::Undefined);
}

bool Section::has(const std::string& key) const {
  known_->insert(key);
  return find(key) != nullptr;
}

bool Section::isList(const std::string& key) const {
  return get(key).IsSequence();
}

void Section::fail(const std::string& key, const std::string& problem) const {
  std::string where = file();
  if (const Layer* layer = find(key)) {
    where = place(lookUp(layer->node, key), layer->file);
  } else if (!layers_.empty()) {
    where = place(layers_.back().node, layers_.back().file);
  }
  throw Error(fmt::format("{}: {}: {}", where, name(key), problem));
}

const std::string& Section::file() const {
  static const std::string kNone = "(no file)";
  return layers_.empty() ? kNone : layers_.front().file;
}

double Section::number(const YAML::Node& node, const std::string& key, Range allowed) const {
  double value = 0.0;
  try {
    value = node.as<double>();
  } catch (const YAML::Exception&) {
    fail(key, fmt::format("expected a number, {}", shown(allowed)));
  }
  if (!std::isfinite(value)) fail(key, "must be a finite number");
  if (value < allowed.min || value > allowed.max)
    fail(key, fmt::format("{} {}", shown(value), shown(allowed)));
  return value;
}

std::vector<double> Section::numbers(const std::string& key, Range allowed) const {
  const YAML::Node node = get(key);
  if (!node.IsSequence()) fail(key, "expected a list of numbers");
  std::vector<double> values;
  for (const auto& item : node) values.push_back(number(item, key, allowed));
  return values;
}

void Section::read(const std::string& key, bool& value) const {
  const YAML::Node node = get(key);
  if (!node.IsDefined()) return;
  try {
    value = node.as<bool>();
  } catch (const YAML::Exception&) {
    fail(key, "expected true or false");
  }
}

void Section::read(const std::string& key, int& value, Range allowed) const {
  const YAML::Node node = get(key);
  if (!node.IsDefined()) return;
  const double real = number(node, key, allowed);
  if (real != std::floor(real) || std::abs(real) > 2147483647.0) fail(key, "expected a whole number");
  value = static_cast<int>(real);
}

void Section::read(const std::string& key, double& value, Range allowed) const {
  const YAML::Node node = get(key);
  if (node.IsDefined()) value = number(node, key, allowed);
}

void Section::read(const std::string& key, std::string& value) const {
  const YAML::Node node = get(key);
  if (!node.IsDefined()) return;
  if (!node.IsScalar()) fail(key, "expected text");
  value = node.Scalar();
}

void Section::read(const std::string& key, std::string& value,
                   const std::vector<std::string>& allowed) const {
  std::string text = value;
  read(key, text);
  if (has(key) && std::find(allowed.begin(), allowed.end(), text) == allowed.end()) {
    fail(key, fmt::format("'{}' must be one of {}", text, fmt::join(allowed, ", ")));
  }
  value = text;
}

void Section::read(const std::string& key, std::vector<double>& value, Range allowed) const {
  if (get(key).IsDefined()) value = numbers(key, allowed);
}

void Section::read(const std::string& key, std::vector<std::string>& value) const {
  const YAML::Node node = get(key);
  if (!node.IsDefined()) return;
  if (!node.IsSequence()) fail(key, "expected a list of names");
  value.clear();
  for (const auto& item : node) {
    if (!item.IsScalar()) fail(key, "expected a list of names");
    value.push_back(item.Scalar());
  }
}

void Section::read(const std::string& key, Eigen::Vector2d& value, Range allowed) const {
  if (!get(key).IsDefined()) return;
  const std::vector<double> v = numbers(key, allowed);
  if (v.size() != 2) fail(key, "expected two numbers [x, y]");
  value = {v[0], v[1]};
}

void Section::read(const std::string& key, Eigen::Vector3d& value, Range allowed) const {
  if (!get(key).IsDefined()) return;
  const std::vector<double> v = numbers(key, allowed);
  if (v.size() != 3) fail(key, "expected three numbers");
  value = {v[0], v[1], v[2]};
}

void Section::read(const std::string& key, std::vector<Eigen::Vector2d>& value) const {
  const YAML::Node node = get(key);
  if (!node.IsDefined()) return;
  if (!node.IsSequence()) fail(key, "expected a list of points [[x, y], …]");
  value.clear();
  for (const auto& item : node) {
    if (!item.IsSequence() || item.size() != 2) fail(key, "expected a list of points [[x, y], …]");
    value.emplace_back(number(item[0], key, {}), number(item[1], key, {}));
  }
}

Section Section::child(const std::string& key) const {
  known_->insert(key);
  Section section;
  section.path_ = name(key);
  for (const Layer& layer : layers_) {
    const YAML::Node node = lookUp(layer.node, key);
    if (!node.IsDefined()) continue;
    section.layers_.push_back({loadMapping(node, layer.file), layer.file});
  }
  // An absent mapping keeps the file for messages.
  if (section.layers_.empty() && !layers_.empty())
    section.layers_.push_back({YAML::Node(YAML::NodeType::Map), layers_.front().file});
  return section;
}

std::vector<Section> Section::list(const std::string& key) const {
  std::vector<Section> sections;
  const YAML::Node node = get(key);
  if (!node.IsDefined()) return sections;
  if (!node.IsSequence()) fail(key, "expected a list");
  const Layer* layer = find(key);
  for (const auto& item : node) {
    Section section;
    section.path_ = fmt::format("{}[{}]", name(key), sections.size());
    section.layers_.push_back({loadMapping(item, layer->file), layer->file});
    sections.push_back(std::move(section));
  }
  return sections;
}

std::vector<std::string> Section::keys() const {
  std::vector<std::string> names;
  for (const Layer& layer : layers_) {
    for (const auto& entry : layer.node) {
      const std::string key = entry.first.Scalar();
      if (key.empty())
        throw Error(fmt::format("{}: {}: the name of an entry is empty; write NAME: before its values",
                                place(entry.second, layer.file), path_.empty() ? "the file" : path_));
      if (std::find(names.begin(), names.end(), key) == names.end()) names.push_back(key);
      known_->insert(key);
    }
  }
  return names;
}

void Section::finish() const {
  for (const Layer& layer : layers_) {
    for (const auto& entry : layer.node) {
      const std::string key = entry.first.Scalar();
      if (known_->count(key)) continue;
      throw Error(fmt::format("{}: {}: unknown key; known here: {}", place(entry.first, layer.file),
                              name(key), fmt::join(*known_, ", ")));
    }
  }
}

}  // namespace omnifleet::options
