#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "geometry/polygon.h"

namespace omnifleet::experiments {

/// Colours that are distinguishable on white, also with colour blindness (Okabe and Ito), BGR.
namespace ink {
inline const cv::Scalar kBlack(50, 42, 36), kGrey(150, 145, 140), kFaint(226, 222, 218),
    kPaper(255, 255, 255), kBlue(178, 114, 0), kGreen(115, 158, 0), kOrange(0, 94, 213),
    kPurple(167, 121, 204), kSky(233, 180, 86), kYellow(0, 159, 230);
/// Colour of the i-th robot in the order of names.
cv::Scalar robot(std::size_t i);
/// Colour of the i-th label, from 0.
cv::Scalar label(std::size_t i);
}  // namespace ink

struct Axes {
  std::string title, x_label, y_label;
  Eigen::Vector2d low{0.0, 0.0}, high{1.0, 1.0};
  bool equal = false;  ///< equal scale on both axes; the limits are widened to fill the frame
  bool log_y = false;  ///< logarithmic y axis; low.y() > 0, smaller values are drawn there; not with equal
};

struct Line {
  cv::Scalar colour = ink::kBlack;
  int width = 2;  ///< pixels
  bool dashed = false;
  bool closed = false;
  std::string name;  ///< in the legend; empty: no entry
};

/// A diagram with axes, ticks, and a legend of the named items in the order of drawing.
class Plot {
 public:
  explicit Plot(const Axes& axes, cv::Size size = {900, 760});

  void line(const std::vector<Eigen::Vector2d>& points, const Line& line);
  void area(const Polygon& polygon, const cv::Scalar& colour, double opacity, const std::string& name = "");
  void dot(const Eigen::Vector2d& at, const cv::Scalar& colour, int radius_px, const std::string& name = "");
  void circle(const Eigen::Vector2d& at, double radius, const Line& line);
  void arrow(const Eigen::Vector2d& from, const Eigen::Vector2d& to, const Line& line);
  /// A vertical bar with end marks, which shows a range of values.
  void bar(double x, double low, double high, const cv::Scalar& colour);
  /// Text centred `up_px` pixels above a point, with a white outline.
  void words(const std::string& text, const Eigen::Vector2d& at, const cv::Scalar& colour, int up_px = 0,
             double size = 0.5);
  /// Outline of a robot with an arrow for its heading.
  void body(const Polygon& outline_in_map, const Eigen::Vector2d& at, double theta_rad,
            const cv::Scalar& colour);

  /// Draws frame, labels and legend, and returns the image. Call it last.
  cv::Mat image();

 private:
  cv::Point fine(const Eigen::Vector2d& at) const;
  cv::Point fineOf(const Eigen::Vector2d& pixel) const;
  Eigen::Vector2d pixel(const Eigen::Vector2d& at) const;
  void remember(const std::string& name, const cv::Scalar& colour, int kind);
  struct Tick {
    double value;
    std::string text;
  };
  std::vector<Tick> ticks(int axis) const;
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

/// Pictures side by side, scaled to the height of the first one, each with its caption above.
cv::Mat beside(const std::vector<cv::Mat>& pictures, const std::vector<std::string>& captions);
/// Rows of pictures, scaled to the width of the first row.
cv::Mat stacked(const std::vector<cv::Mat>& rows);
/// Throws std::runtime_error if the file cannot be written.
void save(const std::string& path, const cv::Mat& picture);

}  // namespace omnifleet::experiments
