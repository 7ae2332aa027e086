#pragma once

#include <yaml-cpp/yaml.h>

#include <Eigen/Core>
#include <limits>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace omnifleet::options {

/// An invalid option. what() is one line: `FILE:LINE: KEY: problem, allowed values`. Programs exit with code
/// 2.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Closed interval of allowed numbers.
struct Range {
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
};
inline constexpr Range kPositive{1e-12, std::numeric_limits<double>::infinity()};
inline constexpr Range kNotNegative{0.0, std::numeric_limits<double>::infinity()};

/// A mapping from one or several layered YAML files. Later layers override earlier ones key by key. Reading a
/// key marks it as known, and `finish()` reports every other key. An absent key keeps the default.
class Section {
 public:
  Section() = default;

  /// Loads `path`. Missing, unreadable or malformed files throw Error.
  static Section load(const std::string& path);
  /// Parses text, for tests. `name` replaces the file name in errors.
  static Section parse(const std::string& text, const std::string& name);

  /// Adds the mapping of another file as the top layer.
  void overlay(const Section& top);

  bool has(const std::string& key) const;
  /// True if the value is a list.
  bool isList(const std::string& key) const;
  void read(const std::string& key, bool& value) const;
  void read(const std::string& key, int& value, Range allowed = {}) const;
  void read(const std::string& key, double& value, Range allowed = {}) const;
  void read(const std::string& key, std::string& value) const;
  void read(const std::string& key, std::string& value, const std::vector<std::string>& allowed) const;
  void read(const std::string& key, std::vector<double>& value, Range allowed = {}) const;
  void read(const std::string& key, std::vector<std::string>& value) const;
  void read(const std::string& key, Eigen::Vector2d& value, Range allowed = {}) const;
  void read(const std::string& key, Eigen::Vector3d& value, Range allowed = {}) const;
  /// A list of points [[x, y], …].
  void read(const std::string& key, std::vector<Eigen::Vector2d>& value) const;

  /// Like read(), but an absent key is an error.
  template <typename T, typename... Allowed>
  void require(const std::string& key, T& value, Allowed&&... allowed) const {
    if (!has(key)) fail(key, "is required");
    read(key, value, std::forward<Allowed>(allowed)...);
  }

  /// The mapping under `key`, or an empty section if the key is absent.
  Section child(const std::string& key) const;
  /// The mappings of the list under `key`.
  std::vector<Section> list(const std::string& key) const;
  /// The keys of this mapping in file order. Marks each as known.
  std::vector<std::string> keys() const;

  /// Throws Error that names the first key of this mapping that was never read. Child sections check their
  /// own keys.
  void finish() const;

  /// Throws Error with the line of `key`, or the line of this mapping if the key is absent.
  [[noreturn]] void fail(const std::string& key, const std::string& problem) const;

  /// File of the lowest layer, for messages and relative paths.
  const std::string& file() const;

 private:
  struct Layer {
    YAML::Node node;
    std::string file;
  };
  std::string name(const std::string& key) const;
  const Layer* find(const std::string& key) const;
  YAML::Node get(const std::string& key) const;
  double number(const YAML::Node& node, const std::string& key, Range allowed) const;
  std::vector<double> numbers(const std::string& key, Range allowed) const;

  std::vector<Layer> layers_;
  std::string path_;
  std::shared_ptr<std::set<std::string>> known_ = std::make_shared<std::set<std::string>>();
};

}  // namespace omnifleet::options
