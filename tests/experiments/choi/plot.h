#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "geometry/polygon.h"

namespace omnifleet::choi {

/// Colours that differ on white, also for the colour-blind (Okabe & Ito), BGR.
namespace ink {
inline const cv::Scalar kBlack(50, 42, 36), kGrey(150, 145, 140), kFaint(226, 222, 218),
    kPaper(255, 255, 255), kBlue(178, 114, 0), kGreen(115, 158, 0), kOrange(0, 94, 213),
    kPurple(167, 121, 204), kSky(233, 180, 86), kYellow(0, 159, 230);
/// Of the i-th robot, by name.
cv::Scalar robot(std::size_t i);
/// Of the i-th label, 0, 1, …
cv::Scalar label(std::size_t i);
}  // namespace ink

struct Axes {
  std::string title, x_label, y_label;
  Eigen::Vector2d low{0.0, 0.0}, high{1.0, 1.0};
  bool equal = false;  ///< one unit is as long on both axes; the limits are widened to fit
};

struct Line {
  cv::Scalar colour = ink::kBlack;
  int width = 2;  ///< pixels
  bool dashed = false;
  bool closed = false;
  std::string name;  ///< in the legend; empty: not there
};

/// A diagram: axes with ticks, a legend that lists what was named, in the order of drawing.
class Plot {
 public:
  explicit Plot(const Axes& axes, cv::Size size = {900, 760});

  void line(const std::vector<Eigen::Vector2d>& points, const Line& line);
  void area(const Polygon& polygon, const cv::Scalar& colour, double opacity, const std::string& name = "");
  void dot(const Eigen::Vector2d& at, const cv::Scalar& colour, int radius_px, const std::string& name = "");
  void circle(const Eigen::Vector2d& at, double radius, const Line& line);
  void arrow(const Eigen::Vector2d& from, const Eigen::Vector2d& to, const Line& line);
  /// A vertical bar with end marks, for spreads.
  void bar(double x, double low, double high, const cv::Scalar& colour);
  /// Words centred `up_px` above a point, readable on anything.
  void words(const std::string& text, const Eigen::Vector2d& at, const cv::Scalar& colour, int up_px = 0,
             double size = 0.5);
  /// A robot's body with its heading.
  void body(const Polygon& outline_in_map, const Eigen::Vector2d& at, double theta_rad,
            const cv::Scalar& colour);

  /// Axes, frame and legend are drawn last.
  cv::Mat image();

 private:
  cv::Point fine(const Eigen::Vector2d& at) const;
  Eigen::Vector2d pixel(const Eigen::Vector2d& at) const;
  void remember(const std::string& name, const cv::Scalar& colour, int kind);
  void drawGrid();
  void drawLegend();

  struct Entry {
    std::string name;
    cv::Scalar colour;
    int kind;  ///< 0 line, 1 dashed line, 2 dot, 3 area
  };
  Axes axes_;
  cv::Mat image_;
  cv::Rect frame_;
  std::vector<Entry> legend_;
};

/// Pictures side by side, each with words above it; all scaled to the height of the first of the row.
cv::Mat beside(const std::vector<cv::Mat>& pictures, const std::vector<std::string>& captions);
/// Rows of pictures, scaled to the width of the first.
cv::Mat stacked(const std::vector<cv::Mat>& rows);
/// Throws std::runtime_error where it cannot be written.
void save(const std::string& path, const cv::Mat& picture);

}  // namespace omnifleet::choi
