#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "dataset/markers.h"
#include "markers/colour_table.h"

namespace omnifleet::markers {

/// A rectangle of a marker in base_link, sides along x and y.
struct Rectangle {
  Eigen::Vector2d centre_m{0.0, 0.0}, half_m{0.0, 0.0};

  bool contains(const Eigen::Vector2d& p) const {
    return ((p - centre_m).cwiseAbs().array() <= half_m.array()).all();
  }
};

/// A visible connected area of one colour on a marker.
struct Component {
  std::uint8_t colour = 0;  ///< class of the colour table
  Eigen::Vector2d centre_m{0.0, 0.0};
  double area_m2 = 0.0;
};

/// A point of a marker, at least half a grid step inside an area of one colour.
struct LabelledPoint {
  Eigen::Vector2d place_m{0.0, 0.0};
  std::uint8_t colour = 0;
};

/// The marker of one robot: the class of each rectangle, and what follows from it.
struct Pattern {
  std::string robot;
  std::vector<std::uint8_t> colours;  ///< class per rectangle
  std::vector<Component> components;
  std::vector<LabelledPoint> points;
};

/// Geometry and colours of a marker set, equal for both kinds: rectangles in painter's order (patches: team,
/// individual; cover_tail_head: cover, tail, head), distinct colours, and one pattern per robot.
class Layout {
 public:
  /// Throws options::Error that names robot and key for a colour that the colour test cannot find, and for
  /// robots whose markers look alike (also when one of them is turned).
  Layout(const dataset::MarkerSet& markers, const ColourOptions& options);

  const std::vector<Rectangle>& rectangles() const { return rectangles_; }
  const std::vector<dataset::Rgb>& colours() const { return colours_; }  ///< colour of class i + 1
  const std::vector<Pattern>& patterns() const { return patterns_; }     ///< ordered by robot
  /// Pairs of colours on one marker.
  const std::vector<ColourPair>& touching() const { return touching_; }
  /// Whether the rectangles form one connected area.
  bool isConnected() const { return connected_; }
  double area() const { return area_m2_; }  ///< m², of all rectangles together
  const Rectangle& bounds() const { return bounds_; }
  /// m, from base_link to the farthest corner.
  double reach() const { return bounds_.centre_m.norm() + bounds_.half_m.norm(); }

 private:
  std::uint8_t classOf(const dataset::Rgb& rgb);
  std::uint8_t labelAt(const Pattern& pattern, const Eigen::Vector2d& place_m) const;
  void describe(Pattern& pattern) const;
  std::vector<Component> componentsOf(const Pattern& pattern) const;
  double difference(const Pattern& a, const Pattern& b, int quarter_turns) const;
  void checkDistinct() const;

  ColourOptions options_;
  std::vector<Rectangle> rectangles_;
  std::vector<dataset::Rgb> colours_;
  std::vector<Pattern> patterns_;
  std::vector<ColourPair> touching_;
  Rectangle bounds_;
  bool connected_ = false;
  double area_m2_ = 0.0;
};

}  // namespace omnifleet::markers
