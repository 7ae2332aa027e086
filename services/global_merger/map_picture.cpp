#include "global_merger/map_picture.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/imgproc.hpp>

namespace omnifleet::global_merger {
namespace {

const cv::Scalar kPaper(255, 255, 255), kUnknown(235, 232, 228), kFree(255, 255, 255), kOccupied(70, 62, 55),
    kLines(222, 216, 210), kInk(60, 52, 45), kFaint(150, 140, 130), kObstacle(60, 110, 230),
    kStructure(120, 84, 28), kRejected(150, 70, 150);
constexpr double kTint = 0.3;                               // opacity of an object over its cells
constexpr int kFont = cv::FONT_HERSHEY_DUPLEX, kShift = 4;  // coordinates in sixteenths of a pixel
constexpr int kTop = 84, kBottom = 136, kSide = 64;

/// Distinguishable on white, also for the colour-blind (Okabe & Ito), BGR.
cv::Scalar robotColour(std::size_t i) {
  static const cv::Scalar kColours[] = {{178, 114, 0},  {115, 158, 0}, {167, 121, 204},
                                        {233, 180, 86}, {0, 94, 213},  {66, 228, 240}};
  return kColours[i % std::size(kColours)];
}

class Canvas {
 public:
  explicit Canvas(const MapPicture& picture) : picture_(picture) {
    findBounds();
    const Eigen::Vector2d size = high_ - low_;
    scale_ = std::clamp(1500.0 / std::max(size.x(), size.y()), 4.0, 400.0);
    const int width = std::max(static_cast<int>(size.x() * scale_), 760) + 2 * kSide;
    left_ = 0.5 * (width - size.x() * scale_);
    image_ = cv::Mat(static_cast<int>(size.y() * scale_) + kTop + kBottom, width, CV_8UC3, kPaper);
  }

  cv::Mat draw() {
    drawCells();
    drawMetreGrid();
    for (const auto& object : picture_.objects) drawObject(object);
    for (const auto& place : picture_.rejected) drawRejected(place);
    std::size_t i = 0;
    for (const auto& [robot, path] : picture_.trajectories) drawRobot(robot, path, robotColour(i++));
    drawTitle();
    drawScaleBar();
    drawLegend();
    return image_;
  }

 private:
  void findBounds();
  void include(const Eigen::Vector2d& p) { low_ = low_.cwiseMin(p), high_ = high_.cwiseMax(p); }
  cv::Point2d pixel(const Eigen::Vector2d& p) const {
    return {left_ + (p.x() - low_.x()) * scale_, kTop + (high_.y() - p.y()) * scale_};
  }
  cv::Point fine(const Eigen::Vector2d& p) const {
    const cv::Point2d at = pixel(p);
    return {cvRound(at.x * (1 << kShift)), cvRound(at.y * (1 << kShift))};
  }
  std::vector<cv::Point> fine(const Polygon& polygon) const {
    std::vector<cv::Point> points;
    for (const auto& p : polygon) points.push_back(fine(p));
    return points;
  }
  void text(const std::string& words, cv::Point at, double size, const cv::Scalar& colour, int weight = 1) {
    cv::putText(image_, words, at, kFont, size, colour, weight, cv::LINE_AA);
  }
  /// Text centred on a point, or beside it if another label is there, with a halo for contrast.
  void label(const std::string& words, const Eigen::Vector2d& at, double size, const cv::Scalar& colour) {
    int base = 0;
    const cv::Size box = cv::getTextSize(words, kFont, size, 1, &base);
    const cv::Point2d centre = pixel(at);
    cv::Rect place(cvRound(centre.x - 0.5 * box.width), cvRound(centre.y - 0.5 * box.height), box.width,
                   box.height);
    const cv::Rect wanted = place;
    const auto taken = [&](const cv::Rect& other) { return (other & place).area() > 0; };
    for (const cv::Point& step : {cv::Point(0, -1), {1, 0}, {-1, 0}, {0, 1}, {1, -1}, {-1, -1}}) {
      if (std::none_of(labels_.begin(), labels_.end(), taken)) break;
      place = wanted + cv::Point(step.x * (box.width + 4), step.y * (box.height + 4));
    }
    labels_.push_back(place);
    const cv::Point from(place.x, place.y + place.height);
    text(words, from, size, kPaper, 4);
    text(words, from, size, colour, 1);
  }
  /// A translucent filled polygon.
  void tint(const Polygon& polygon, const cv::Scalar& colour, double strength) {
    const auto points = fine(polygon);
    if (points.size() < 3) return;
    cv::Mat over = image_.clone();
    cv::fillPoly(over, std::vector<std::vector<cv::Point>>{points}, colour, cv::LINE_AA, kShift);
    cv::addWeighted(over, strength, image_, 1.0 - strength, 0.0, image_);
  }
  void outline(const Polygon& polygon, const cv::Scalar& colour, int width) {
    const auto points = fine(polygon);
    cv::polylines(image_, std::vector<std::vector<cv::Point>>{points}, true, colour, width, cv::LINE_AA,
                  kShift);
  }

  void drawCells();
  void drawMetreGrid();
  void drawObject(const dataset::MapObject& object);
  void drawStructure(const dataset::MapObject& object);
  void drawRejected(const dataset::RejectedPlace& place);
  std::string numberOf(const std::string& reason) const;
  void drawRobot(const std::string& robot, const std::vector<dataset::StampedPose>& path,
                 const cv::Scalar& colour);
  void drawTitle();
  void drawScaleBar();
  void drawLegend();

  const MapPicture& picture_;
  cv::Mat image_;
  std::vector<cv::Rect> labels_;  // areas of the labels drawn so far
  Eigen::Vector2d low_{1e9, 1e9}, high_{-1e9, -1e9};
  double scale_ = 1.0, left_ = 0.0;
};

void Canvas::findBounds() {
  const auto& grid = picture_.grid;
  if (grid.width > 0) {
    include(grid.origin_m);
    include(grid.origin_m + grid.resolution_m * Eigen::Vector2d(grid.width, grid.height));
  }
  for (const auto& object : picture_.objects)
    std::for_each(object.outline_m.begin(), object.outline_m.end(), [&](const auto& p) { include(p); });
  for (const auto& [robot, path] : picture_.trajectories) {
    for (const auto& pose : path) include(pose.map_from_base.translation());
  }
  if (low_.x() > high_.x()) low_ = {-1.0, -1.0}, high_ = {1.0, 1.0};
  low_.array() -= 0.15, high_.array() += 0.15;
}

void Canvas::drawCells() {
  cv::rectangle(image_, pixel({low_.x(), high_.y()}), pixel({high_.x(), low_.y()}), kUnknown, cv::FILLED);
  const auto& grid = picture_.grid;
  for (int y = 0; y < grid.height; ++y) {
    for (int x = 0; x < grid.width; ++x) {
      const auto cell = grid.cells[static_cast<std::size_t>(y) * static_cast<std::size_t>(grid.width) +
                                   static_cast<std::size_t>(x)];
      if (cell < 0) continue;
      const Eigen::Vector2d corner = grid.origin_m + grid.resolution_m * Eigen::Vector2d(x, y);
      // The far corner equals the corner of the next cell to the last bit, so there is no gap.
      const Eigen::Vector2d next = grid.origin_m + grid.resolution_m * Eigen::Vector2d(x + 1, y + 1);
      const cv::Point2d a = pixel(corner), b = pixel(next);
      const cv::Rect box(cv::Point(cvRound(a.x), cvRound(b.y)), cv::Point(cvRound(b.x), cvRound(a.y)));
      image_(box & cv::Rect({}, image_.size())).setTo(cell >= 50 ? kOccupied : kFree);
    }
  }
}

void Canvas::drawMetreGrid() {
  const double span = std::max(high_.x() - low_.x(), high_.y() - low_.y());
  const double step = span > 40   ? std::pow(10.0, std::ceil(std::log10(span / 40.0)))
                      : span > 16 ? 5.0
                      : span > 6  ? 1.0
                                  : 0.5;
  char words[32];
  const auto name = [&](double value) {
    std::snprintf(words, sizeof words, step < 1 ? "%.1f" : "%.0f", std::abs(value) < 1e-9 ? 0.0 : value);
    return std::string(words);
  };
  for (double x = std::ceil(low_.x() / step) * step; x <= high_.x(); x += step) {
    cv::line(image_, fine({x, low_.y()}), fine({x, high_.y()}), kLines, 1, cv::LINE_AA, kShift);
    const cv::Point2d at = pixel({x, low_.y()});
    text(name(x), {cvRound(at.x) - 8, cvRound(at.y) + 20}, 0.45, kFaint);
  }
  for (double y = std::ceil(low_.y() / step) * step; y <= high_.y(); y += step) {
    cv::line(image_, fine({low_.x(), y}), fine({high_.x(), y}), kLines, 1, cv::LINE_AA, kShift);
    const cv::Point2d at = pixel({low_.x(), y});
    text(name(y), {cvRound(at.x) - 40, cvRound(at.y) + 5}, 0.45, kFaint);
  }
}

/// Walls and furniture: a thick line, as one would draw them.
void Canvas::drawStructure(const dataset::MapObject& object) {
  const auto points = fine(object.outline_m);
  cv::polylines(image_, std::vector<std::vector<cv::Point>>{points}, false, kStructure,
                std::clamp(cvRound(0.03 * scale_), 2, 9), cv::LINE_AA, kShift);
}

/// A hatched disc with the number of its reason in the legend.
void Canvas::drawRejected(const dataset::RejectedPlace& place) {
  constexpr double kRadius_m = 0.12;
  const cv::Point2d centre = pixel(place.at_m);
  const double radius = kRadius_m * scale_;
  const auto at = [&](double x, double y) {
    return cv::Point(cvRound((centre.x + x) * (1 << kShift)), cvRound((centre.y + y) * (1 << kShift)));
  };
  for (double offset = -0.8; offset <= 0.81; offset += 0.4) {
    const double half = std::sqrt(1.0 - offset * offset), d = std::sqrt(0.5);
    // The line x·d + y·d = offset within the disc.
    cv::line(image_, at(radius * d * (offset - half), radius * d * (offset + half)),
             at(radius * d * (offset + half), radius * d * (offset - half)), kRejected, 1, cv::LINE_AA,
             kShift);
  }
  cv::circle(image_, at(0, 0), cvRound(radius * (1 << kShift)), kRejected, 1, cv::LINE_AA, kShift);
  label(numberOf(place.reason), place.at_m, 0.5, kRejected);
}

/// Reasons are numbered in the order in which they occur.
std::string Canvas::numberOf(const std::string& reason) const {
  std::vector<std::string> reasons;
  for (const dataset::RejectedPlace& place : picture_.rejected)
    if (std::find(reasons.begin(), reasons.end(), place.reason) == reasons.end())
      reasons.push_back(place.reason);
  return std::to_string(std::find(reasons.begin(), reasons.end(), reason) - reasons.begin() + 1);
}

void Canvas::drawObject(const dataset::MapObject& object) {
  if (object.isOpen()) {
    drawStructure(object);
    return;
  }
  if (object.outline_m.size() < 3) return;
  tint(object.outline_m, kObstacle, kTint);
  outline(object.outline_m, kObstacle, 2);
  double top = object.outline_m.front().y();
  for (const auto& p : object.outline_m) top = std::max(top, p.y());
  label("#" + std::to_string(object.id), {object.centroid_m.x(), top + 14.0 / scale_}, 0.5, kInk);
}

void Canvas::drawRobot(const std::string& robot, const std::vector<dataset::StampedPose>& path,
                       const cv::Scalar& colour) {
  if (path.empty()) return;
  Polygon way;
  for (const auto& pose : path) way.push_back(pose.map_from_base.translation());
  const auto points = fine(way);
  cv::polylines(image_, std::vector<std::vector<cv::Point>>{points}, false, kPaper, 6, cv::LINE_AA, kShift);
  cv::polylines(image_, std::vector<std::vector<cv::Point>>{points}, false, colour, 3, cv::LINE_AA, kShift);
  cv::circle(image_, points.front(), 5 << kShift, colour, cv::FILLED, cv::LINE_AA, kShift);

  const Pose2 now = path.back().map_from_base;
  const auto found = picture_.bodies.find(robot);
  Polygon body, arrow;
  for (const auto& p :
       found == picture_.bodies.end() ? circlePolygon({0, 0}, 0.15, 48) : found->second.outline())
    body.push_back(now * p);
  double reach = 0.0;
  for (const auto& p : body) reach = std::max(reach, (p - now.translation()).norm());
  for (const auto& [x, y] : {std::pair{0.85, 0.0}, {-0.45, 0.5}, {-0.15, 0.0}, {-0.45, -0.5}})
    arrow.push_back(now * Eigen::Vector2d(x * reach, y * reach));
  tint(body, colour, 0.35);
  outline(body, colour, 2);
  cv::fillPoly(image_, std::vector<std::vector<cv::Point>>{fine(arrow)}, colour, cv::LINE_AA, kShift);
  label(robot, now.translation() + Eigen::Vector2d(0.0, reach + 14.0 / scale_), 0.6, colour);
}

void Canvas::drawTitle() {
  text("omnifleet  " +
           (picture_.frame.empty() ? "merged map" : "map of " + picture_.frame + " in its own frame"),
       {kSide, 38}, 0.95, kInk, 1);
  double length = 0.0;
  for (const auto& [robot, path] : picture_.trajectories) {
    for (std::size_t i = 1; i < path.size(); ++i) {
      length += (path[i].map_from_base.translation() - path[i - 1].map_from_base.translation()).norm();
    }
  }
  char words[160];
  const auto obstacles = std::count_if(picture_.objects.begin(), picture_.objects.end(),
                                       [](const auto& o) { return !o.isOpen(); });
  std::snprintf(words, sizeof words, "%td obstacles, %zu robots, %.1f m driven, cells of %.0f cm", obstacles,
                picture_.trajectories.size(), length, 100 * picture_.grid.resolution_m);
  text(words, {kSide, 64}, 0.55, kFaint, 1);
}

void Canvas::drawScaleBar() {
  double length = 0.1;
  for (const double choice : {0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0}) {
    if (choice * scale_ < 320) length = choice;
  }
  const int y = image_.rows - 34, right = image_.cols - kSide, left = right - cvRound(length * scale_);
  cv::line(image_, {left, y}, {right, y}, kInk, 2, cv::LINE_AA);
  for (const int x : {left, right}) cv::line(image_, {x, y - 6}, {x, y + 6}, kInk, 2, cv::LINE_AA);
  char words[32];
  std::snprintf(words, sizeof words, length < 1 ? "%.2g m" : "%.0f m", length);
  text(words, {(left + right) / 2 - 20, y - 10}, 0.5, kInk);
}

void Canvas::drawLegend() {
  int x = kSide;
  int y = image_.rows - kBottom + 40;
  const int scale_bar = image_.cols - kSide - 340;  // the longest scale bar begins here
  const auto entry = [&](const std::string& words, const cv::Scalar& fill, const cv::Scalar& edge) {
    const int width = 40 + cv::getTextSize(words, kFont, 0.5, 1, nullptr).width;
    if (x > kSide && x + width > scale_bar) x = kSide, y += 22;
    cv::rectangle(image_, {x, y}, {x + 18, y + 14}, fill, cv::FILLED);
    cv::rectangle(image_, {x, y}, {x + 18, y + 14}, edge, 1, cv::LINE_AA);
    text(words, {x + 26, y + 13}, 0.5, kInk);
    x += width;
  };
  entry("free", kFree, kFaint);
  entry("occupied", kOccupied, kOccupied);
  entry("unknown", kUnknown, kFaint);
  entry("obstacle #id of objects.geojson", (1.0 - kTint) * kOccupied + kTint * kObstacle, kObstacle);
  if (std::any_of(picture_.objects.begin(), picture_.objects.end(), [](const auto& o) { return o.isOpen(); }))
    entry("wall or furniture, outline open", kStructure, kStructure);
  std::size_t i = 0;
  for (const auto& [robot, path] : picture_.trajectories) {
    if (i < 8) entry(robot, robotColour(i), robotColour(i));
    ++i;
  }
  std::vector<std::string> listed;
  for (const dataset::RejectedPlace& place : picture_.rejected) {
    if (std::find(listed.begin(), listed.end(), place.reason) != listed.end()) continue;
    listed.push_back(place.reason);
    std::string words = place.reason;
    std::replace(words.begin(), words.end(), '_', ' ');
    entry(numberOf(place.reason) + "  not mapped: " + words, kPaper, kRejected);
  }
}

}  // namespace

cv::Mat drawMap(const MapPicture& picture) {
  return Canvas(picture).draw();
}

}  // namespace omnifleet::global_merger
