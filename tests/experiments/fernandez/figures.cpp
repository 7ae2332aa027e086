#include "tests/experiments/fernandez/figures.h"

#include <fmt/format.h>

#include <algorithm>
#include <complex>
#include <limits>

#include "dataset/ground_truth.h"
#include "tests/experiments/fernandez/heat_map.h"
#include "tests/experiments/plot/plot.h"

namespace omnifleet::fernandez {
namespace {

namespace ink = experiments::ink;
using Points = std::vector<Eigen::Vector2d>;

Eigen::Vector2d meanOf(const Points& points) {
  Eigen::Vector2d sum(0.0, 0.0);
  for (const Eigen::Vector2d& point : points) sum += point;
  return sum / static_cast<double>(points.size());
}

/// Scaled, turned and moved onto the truth by least squares: a complex factor between centred points.
Points ontoTruth(const Points& points, const Points& truth) {
  const Eigen::Vector2d from = meanOf(points), to = meanOf(truth);
  std::complex<double> product = 0.0;
  double squares = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector2d p = points[i] - from, t = truth[i] - to;
    product += std::complex<double>(t.x(), t.y()) * std::complex<double>(p.x(), -p.y());
    squares += p.squaredNorm();
  }
  const std::complex<double> factor = squares > 0.0 ? product / squares : 1.0;
  Points fitted;
  for (const Eigen::Vector2d& point : points) {
    const Eigen::Vector2d p = point - from;
    const std::complex<double> at = factor * std::complex<double>(p.x(), p.y());
    fitted.emplace_back(to + Eigen::Vector2d(at.real(), at.imag()));
  }
  return fitted;
}

void grow(experiments::Axes& axes, const Points& points) {
  constexpr double kMargin_m = 0.2;
  for (const Eigen::Vector2d& point : points) {
    axes.low = axes.low.cwiseMin(point - Eigen::Vector2d::Constant(kMargin_m));
    axes.high = axes.high.cwiseMax(point + Eigen::Vector2d::Constant(kMargin_m));
  }
}

experiments::Axes axesFor(const std::string& title) {
  experiments::Axes axes;
  axes.title = title;
  axes.x_label = "x, m";
  axes.y_label = "y, m";
  axes.low = Eigen::Vector2d::Constant(std::numeric_limits<double>::max());
  axes.high = -axes.low;
  axes.equal = true;
  return axes;
}

std::pair<double, double> rangeOf(const std::vector<Surface>& surfaces) {
  double low = std::numeric_limits<double>::max(), high = 0.0;
  for (const Surface& surface : surfaces)
    for (const auto& row : surface)
      for (const double value : row) {
        low = std::min(low, value);
        high = std::max(high, value);
      }
  return {std::max(low, 1e-6), std::max(high, 2e-6)};
}

std::string every(int step) {
  return step == 1 ? "all images" : fmt::format("one image in {}", step);
}

}  // namespace

void drawPath(const std::string& recording, const StudyResult& study, int set, const std::string& file) {
  const dataset::GroundTruth truth = dataset::GroundTruth::load(recording);
  const Points& path = study.paths.at("truth");
  experiments::Axes axes =
      axesFor(fmt::format("Set {}: {} images along {:.1f} m", set, study.images, study.length_m));
  grow(axes, truth.room);
  grow(axes, path);
  experiments::Plot plot(axes);
  if (!truth.room.empty()) {
    experiments::Line wall{ink::kBlack, 2, false, true, "walls"};
    plot.line(truth.room, wall);
  }
  for (const dataset::MapObject& object : truth.scene)
    plot.area(object.outline_m, ink::kGrey, 0.6, "furniture");
  plot.line(path, {ink::kBlue, 2, false, false, "path"});
  for (const Eigen::Vector2d& point : path) plot.dot(point, ink::kBlue, 2);
  plot.dot(path.front(), ink::kGreen, 7, "first image");
  plot.dot(path.back(), ink::kOrange, 7, "last image");
  experiments::save(file, plot.image());
}

void drawMaps(const StudyResult& study, int set, const std::string& file) {
  struct Shown {
    const char* path;
    const char* name;
    cv::Scalar colour;
  };
  const std::vector<Shown> shown{{"literal", "literal", ink::kOrange},
                                 {"odometry", "odometry", ink::kGrey},
                                 {"omnifleet", "omnifleet, no wheels", ink::kBlue},
                                 {"omnifleet_wheels", "omnifleet", ink::kGreen}};
  const Points& truth = study.paths.at("truth");
  const auto panel = [&](const std::string& title, std::size_t first, std::size_t end) {
    experiments::Axes axes = axesFor(title);
    grow(axes, truth);
    for (std::size_t i = first; i < end; ++i)
      if (study.paths.count(shown[i].path) > 0) grow(axes, ontoTruth(study.paths.at(shown[i].path), truth));
    experiments::Plot plot(axes);
    plot.line(truth, {ink::kBlack, 2, true, false, "truth"});
    for (std::size_t i = first; i < end; ++i) {
      const auto found = study.paths.find(shown[i].path);
      if (found == study.paths.end()) continue;
      const Points points = ontoTruth(found->second, truth);
      plot.line(points, {shown[i].colour, 2, false, false, shown[i].name});
      for (const Eigen::Vector2d& point : points) plot.dot(point, shown[i].colour, 2);
    }
    return plot.image();
  };
  experiments::save(file, experiments::beside({panel("", 0, 2), panel("", 2, shown.size())},
                                              {fmt::format("Set {}: literal method, k1 = k2 = 64", set),
                                               fmt::format("Set {}: omnifleet, k1 = k2 = 64", set)}));
}

void drawShape(const StudyResult& study, const std::string& method, int set, const std::string& file) {
  const std::vector<Surface>& surfaces = study.shape.at(method);
  const auto [low, high] = rangeOf(surfaces);
  std::vector<cv::Mat> panels;
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    HeatMap map{fmt::format("({}) {}", static_cast<char>('a' + i), every(static_cast<int>(i) + 1)),
                "k2, phase components",
                "k1",
                study.terms,
                surfaces[i],
                low,
                high,
                4};
    panels.push_back(draw(map));
  }
  std::vector<cv::Mat> pictures;
  for (std::size_t i = 0; i + 1 < panels.size(); i += 2) {
    const std::string caption =
        i == 0 ? fmt::format("Shape difference, set {}, {}; frame: least", set, method) : std::string();
    pictures.push_back(experiments::beside({panels[i], panels[i + 1]}, {caption, ""}));
  }
  experiments::save(file, experiments::stacked(pictures));
}

void drawTime(const StudyResult& study, int set, const std::string& file) {
  std::vector<cv::Mat> pictures;
  for (const auto& [method, surfaces] : study.build_s) {
    std::vector<Surface> milliseconds = surfaces;
    for (Surface& surface : milliseconds)
      for (auto& row : surface)
        for (double& value : row) value *= 1e3;
    const auto [low, high] = rangeOf(milliseconds);
    std::vector<cv::Mat> panels;
    for (std::size_t i = 0; i < milliseconds.size(); ++i)
      panels.push_back(
          draw({fmt::format("({}) {}", static_cast<char>('a' + i), every(static_cast<int>(i) + 1)),
                "k2, phase components", "k1", study.terms, milliseconds[i], low, high, 1, false}));
    std::vector<std::string> captions(panels.size());
    captions.front() = fmt::format("Time to build the map, ms, set {}, {}", set, method);
    pictures.push_back(experiments::beside(panels, captions));
  }
  if (!pictures.empty()) experiments::save(file, experiments::stacked(pictures));
}

}  // namespace omnifleet::fernandez
