#include "markers/layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

namespace omnifleet::markers {
namespace {

constexpr int kGrid = 48;                  // cells along each side of a marker
constexpr int kEachPoint = 4;              // every fourth cell is a labelled point
constexpr double kMergedTolerance = 0.5;   // share of chroma_tolerance: nearer colours are one class
constexpr double kLeastDifference = 0.08;  // share of a marker's area that must differ between two robots

/// A colour of the set with the key of markers.yaml that gives it.
struct NamedColour {
  std::string key;
  dataset::Rgb rgb;
};

std::vector<NamedColour> coloursOf(const dataset::MarkerSet& set, const std::string& robot) {
  const dataset::RobotColours& c = set.robots.at(robot);
  const std::string prefix = "robots." + robot + ".";
  if (set.kind == dataset::MarkerKind::kPatches)
    return {{"team_rgb", set.team}, {prefix + "rgb", c.individual}};
  return {{prefix + "cover_rgb", c.cover}, {prefix + "tail_rgb", c.tail}, {prefix + "head_rgb", c.head}};
}

void checkUsable(const NamedColour& colour, const ColourOptions& options) {
  const auto [darkest, brightest] = std::minmax_element(colour.rgb.begin(), colour.rgb.end());
  const std::string value =
      fmt::format("markers: {}: [{}, {}, {}]", colour.key, colour.rgb[0], colour.rgb[1], colour.rgb[2]);
  if (*brightest < options.min_brightness) {
    throw options::Error(
        fmt::format("{} is too dark: its brightest channel must be at least {} (min_brightness)", value,
                    options.min_brightness));
  }
  const double saturation = 1.0 - 1.0 * *darkest / *brightest;
  if (saturation < options.min_saturation) {
    throw options::Error(
        fmt::format("{} is not usable: saturation 1 - min/max is {:.2f}, the minimum is {} (min_saturation). "
                    "Use a colour that is not black, white or grey",
                    value, saturation, options.min_saturation));
  }
}

}  // namespace

Layout::Layout(const dataset::MarkerSet& markers, const ColourOptions& options) : options_(options) {
  if (markers.kind == dataset::MarkerKind::kPatches) {
    rectangles_ = {{markers.team_offset_m, 0.5 * markers.patch_size_m},
                   {markers.individual_offset_m, 0.5 * markers.patch_size_m}};
  } else {
    rectangles_ = {{{0.0, 0.0}, 0.5 * markers.cover_size_m},
                   {markers.tail_offset_m, 0.5 * markers.tail_size_m},
                   {markers.head_offset_m, 0.5 * markers.head_size_m}};
  }
  Eigen::Array2d low(1e9, 1e9), high(-1e9, -1e9);
  for (const Rectangle& r : rectangles_) {
    low = low.min((r.centre_m - r.half_m).array());
    high = high.max((r.centre_m + r.half_m).array());
  }
  bounds_ = {0.5 * (low + high), 0.5 * (high - low)};

  for (const auto& [robot, unused] : markers.robots) {
    Pattern pattern;
    pattern.robot = robot;
    for (const NamedColour& colour : coloursOf(markers, robot)) {
      checkUsable(colour, options_);
      pattern.colours.push_back(classOf(colour.rgb));
    }
    describe(pattern);
    for (std::size_t i = 0; i < pattern.colours.size(); ++i)
      for (std::size_t k = 0; k < i; ++k)
        if (pattern.colours[i] != pattern.colours[k])
          touching_.push_back({pattern.colours[i] - 1U, pattern.colours[k] - 1U});
    patterns_.push_back(std::move(pattern));
  }
  Pattern silhouette;
  silhouette.colours.assign(rectangles_.size(), 1);
  const std::vector<Component> parts = componentsOf(silhouette);
  connected_ = parts.size() == 1;
  for (const Component& part : parts) area_m2_ += part.area_m2;
  checkDistinct();
}

/// Class of a colour. A colour that is nearly equal to an earlier one shares its class: two classes would
/// divide the pixels of one area by noise.
std::uint8_t Layout::classOf(const dataset::Rgb& rgb) {
  for (std::size_t i = 0; i < colours_.size(); ++i) {
    if (chromaDistance(colours_[i], rgb) < kMergedTolerance * options_.chroma_tolerance)
      return static_cast<std::uint8_t>(i + 1);
  }
  if (colours_.size() == 250) throw options::Error("markers: at most 250 distinct colours are supported");
  colours_.push_back(rgb);
  return static_cast<std::uint8_t>(colours_.size());
}

std::uint8_t Layout::labelAt(const Pattern& pattern, const Eigen::Vector2d& place_m) const {
  for (std::size_t i = rectangles_.size(); i-- > 0;)
    if (rectangles_[i].contains(place_m)) return pattern.colours[i];
  return 0;
}

void Layout::describe(Pattern& pattern) const {
  pattern.components = componentsOf(pattern);
  const Eigen::Vector2d step = 2.0 * bounds_.half_m / kGrid, low = bounds_.centre_m - bounds_.half_m;
  for (int i = kEachPoint / 2; i < kGrid; i += kEachPoint) {
    for (int j = kEachPoint / 2; j < kGrid; j += kEachPoint) {
      const Eigen::Vector2d place = low + Eigen::Vector2d(i + 0.5, j + 0.5).cwiseProduct(step);
      const std::uint8_t colour = labelAt(pattern, place);
      bool inside = colour != 0;
      for (const int di : {-1, 0, 1})
        for (const int dj : {-1, 0, 1})
          inside = inside &&
                   labelAt(pattern, place + 0.5 * kEachPoint * Eigen::Vector2d(di, dj).cwiseProduct(step)) ==
                       colour;
      if (inside) pattern.points.push_back({place, colour});
    }
  }
}

/// Connected areas of one colour, on a grid over the marker.
std::vector<Component> Layout::componentsOf(const Pattern& pattern) const {
  const Eigen::Vector2d step = 2.0 * bounds_.half_m / kGrid, low = bounds_.centre_m - bounds_.half_m;
  const auto placeOf = [&](int i, int j) {
    return Eigen::Vector2d(low + Eigen::Vector2d(i + 0.5, j + 0.5).cwiseProduct(step));
  };
  std::array<std::array<std::uint8_t, kGrid>, kGrid> labels{};
  const auto at = [&](int i, int j) -> std::uint8_t& {
    return labels[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
  };
  for (int i = 0; i < kGrid; ++i)
    for (int j = 0; j < kGrid; ++j) at(i, j) = labelAt(pattern, placeOf(i, j));
  std::vector<Component> components;
  std::vector<std::pair<int, int>> open;
  for (int i = 0; i < kGrid; ++i) {
    for (int j = 0; j < kGrid; ++j) {
      const std::uint8_t colour = at(i, j);
      if (colour == 0) continue;
      Eigen::Vector2d sum(0.0, 0.0);
      int count = 0;
      open.assign(1, {i, j});
      at(i, j) = 0;
      while (!open.empty()) {
        const auto [k, l] = open.back();
        open.pop_back();
        sum += placeOf(k, l);
        ++count;
        for (const auto& [dk, dl] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
          const int m = k + dk, n = l + dl;
          if (m < 0 || n < 0 || m >= kGrid || n >= kGrid || at(m, n) != colour) continue;
          at(m, n) = 0;
          open.emplace_back(m, n);
        }
      }
      components.push_back({colour, sum / count, count * step.prod()});
    }
  }
  return components;
}

/// Share of the marker's area on which two patterns differ when b is turned about the middle of the marker.
double Layout::difference(const Pattern& a, const Pattern& b, int quarter_turns) const {
  const Eigen::Matrix2d turn = Eigen::Rotation2Dd(0.5 * M_PI * quarter_turns).toRotationMatrix();
  const double half = bounds_.half_m.maxCoeff();
  int painted = 0, different = 0;
  for (int i = 0; i < kGrid; ++i) {
    for (int j = 0; j < kGrid; ++j) {
      const Eigen::Vector2d p =
          half * Eigen::Vector2d(2.0 * (i + 0.5) / kGrid - 1.0, 2.0 * (j + 0.5) / kGrid - 1.0);
      const int one = labelAt(a, bounds_.centre_m + p), other = labelAt(b, bounds_.centre_m + turn * p);
      painted += one != 0 || other != 0 ? 1 : 0;
      different += one != other ? 1 : 0;
    }
  }
  return 1.0 * different / std::max(1, painted);
}

void Layout::checkDistinct() const {
  for (std::size_t i = 0; i < patterns_.size(); ++i) {
    for (std::size_t j = i; j < patterns_.size(); ++j) {
      for (int turns = i == j ? 1 : 0; turns < 4; ++turns) {
        if (difference(patterns_[i], patterns_[j], turns) >= kLeastDifference) continue;
        const std::string &a = patterns_[i].robot, &b = patterns_[j].robot;
        if (i == j)
          throw options::Error(fmt::format(
              "markers: robots.{}: the marker looks the same when it is turned by {}°, so it has no heading",
              a, 90 * turns));
        throw options::Error(fmt::format(
            "markers: robots.{} and robots.{}: the markers look the same{}. Change a colour by more than "
            "{:.2f} (distance of the colours divided by their largest channels)",
            a, b, turns == 0 ? std::string() : fmt::format(" when one is turned by {}°", 90 * turns),
            kMergedTolerance * options_.chroma_tolerance));
      }
    }
  }
}

}  // namespace omnifleet::markers
