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

/// A bad option. what() is one line: `FILE:LINE: KEY: what is wrong, what is allowed`. Programs exit with
/// code 2.
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

/// A mapping in one or several layered YAML files (later layers override earlier ones, key by key). Reading a
/// key marks it known; `finish()` reports every key that nobody read. A key that is absent leaves the
/// default.
class Section {
 public:
  Section() = default;

  /// Load `path`; missing, unreadable or malformed files throw Error.
  static Section load(const std::string& path);
  /// From text, for tests; `name` stands for the file in errors.
  static Section parse(const std::string& text, const std::string& name);

  /// Put the mapping of another file on top of this one.
  void overlay(const Section& top);

  bool has(const std::string& key) const;
  /// True where the value is a list.
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

  /// As read(), but an absent key is an error.
  template <typename T, typename... Allowed>
  void require(const std::string& key, T& value, Allowed&&... allowed) const {
    if (!has(key)) fail(key, "is required");
    read(key, value, std::forward<Allowed>(allowed)...);
  }

  /// The mapping under `key`; an empty section when absent.
  Section child(const std::string& key) const;
  /// The mappings in a list under `key`.
  std::vector<Section> list(const std::string& key) const;
  /// The keys of this mapping, in file order, each marked known.
  std::vector<std::string> keys() const;

  /// Throws Error naming the first key that was never read here (children check their own).
  void finish() const;

  /// Throws Error at the place of `key` (or of this mapping where the key is absent).
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
