#include "tests/experiments/plot/plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

namespace omnifleet::experiments {
namespace {

constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX, kShift = 4;
constexpr int kLeft = 84, kRight = 24, kTop = 52, kBottom = 64;

cv::Size sizeOf(const std::string& text, double size) {
  int base = 0;
  return cv::getTextSize(text, kFont, size, 1, &base);
}

void write(cv::Mat& image, const std::string& text, cv::Point at, double size, const cv::Scalar& colour,
           int weight = 1) {
  cv::putText(image, text, at, kFont, size, colour, weight, cv::LINE_AA);
}

/// Tick distance: 1, 2 or 5 times a power of ten, so that about `wanted` ticks fit into the span.
double tickStep(double span, double wanted) {
  const double raw = span / wanted, power = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= raw) return factor * power;
  }
  return 10.0 * power;
}

std::string number(double value, double step) {
  const int decimals = std::max(0, static_cast<int>(std::ceil(-std::log10(step) - 1e-9)));
  char text[32];
  std::snprintf(text, sizeof text, "%.*f", decimals, std::abs(value) < 1e-9 ? 0.0 : value);
  return text;
}

/// Place of that size at the left or right side of the frame with the fewest drawn pixels; among equals the
/// upper right one.
cv::Rect emptiest(const cv::Mat& image, const cv::Rect& frame, cv::Size size) {
  constexpr int kMargin_px = 6, kDrawn = 190;  // grey level; the grid is lighter, drawn items are darker
  const int right = frame.br().x - size.width - kMargin_px, bottom = frame.br().y - size.height - kMargin_px;
  const int left = frame.x + kMargin_px, top = frame.y + kMargin_px, middle = (top + bottom) / 2;
  cv::Rect best;
  int least = image.rows * image.cols + 1;
  for (const cv::Point& at : {cv::Point(right, top), cv::Point(right, bottom), cv::Point(right, middle),
                              cv::Point(left, top), cv::Point(left, bottom), cv::Point(left, middle)}) {
    const cv::Rect place = cv::Rect(at, size) & cv::Rect({}, image.size());
    cv::Mat empty;
    cv::inRange(image(place), cv::Scalar::all(kDrawn), cv::Scalar::all(255), empty);
    const int ink = place.area() - cv::countNonZero(empty);
    if (ink < least) {
      least = ink;
      best = place;
    }
  }
  return best;
}

}  // namespace

cv::Scalar ink::robot(std::size_t i) {
  const std::array<cv::Scalar, 6> colours{kBlue, kGreen, kPurple, kSky, kOrange, kYellow};
  return colours[i % colours.size()];
}

cv::Scalar ink::label(std::size_t i) {
  const std::array<cv::Scalar, 7> colours{kYellow, kSky, kGreen, kOrange, kPurple, kBlue, kGrey};
  return colours[i % colours.size()];
}

Plot::Plot(const Axes& axes, cv::Size size)
    : axes_(axes),
      image_(size, CV_8UC3, ink::kPaper),
      frame_(kLeft, kTop, size.width - kLeft - kRight, size.height - kTop - kBottom) {
  Eigen::Vector2d span = (axes_.high - axes_.low).cwiseMax(1e-9);
  if (axes_.equal) {
    const double scale = std::min(frame_.width / span.x(), frame_.height / span.y());
    const Eigen::Vector2d wide(frame_.width / scale, frame_.height / scale);
    const Eigen::Vector2d middle = 0.5 * (axes_.low + axes_.high);
    axes_.low = middle - 0.5 * wide;
    axes_.high = middle + 0.5 * wide;
  }
  drawGrid();
}

Eigen::Vector2d Plot::pixel(const Eigen::Vector2d& at) const {
  Eigen::Vector2d share = (at - axes_.low).cwiseQuotient(axes_.high - axes_.low);
  if (axes_.log_y)
    share.y() =
        std::log(std::max(at.y(), axes_.low.y()) / axes_.low.y()) / std::log(axes_.high.y() / axes_.low.y());
  // Limited, because the pixel coordinates are converted to integers.
  const Eigen::Vector2d bounded = share.cwiseMax(-20.0).cwiseMin(20.0);
  return {frame_.x + bounded.x() * frame_.width, frame_.y + (1.0 - bounded.y()) * frame_.height};
}

cv::Point Plot::fine(const Eigen::Vector2d& at) const {
  return fineOf(pixel(at));
}

cv::Point Plot::fineOf(const Eigen::Vector2d& pixel) const {
  const Eigen::Vector2d p = pixel - Eigen::Vector2d(frame_.x, frame_.y);
  return {cvRound(p.x() * (1 << kShift)), cvRound(p.y() * (1 << kShift))};
}

void Plot::remember(const std::string& name, const cv::Scalar& colour, int kind) {
  if (name.empty()) return;
  const bool known =
      std::any_of(legend_.begin(), legend_.end(), [&](const Entry& e) { return e.name == name; });
  if (!known) legend_.push_back({name, colour, kind});
}

std::vector<Plot::Tick> Plot::ticks(int axis) const {
  const double low = axes_.low[axis], high = axes_.high[axis];
  std::vector<Tick> ticks;
  if (axis == 1 && axes_.log_y) {
    for (double power = std::pow(10.0, std::floor(std::log10(low))); power <= high; power *= 10.0)
      for (const double factor : {1.0, 2.0, 5.0})
        if (const double v = factor * power; v >= low * (1.0 - 1e-9) && v <= high * (1.0 + 1e-9))
          ticks.push_back({v, number(v, power)});
    return ticks;
  }
  const double step = tickStep(high - low, axis == 0 ? frame_.width / 90.0 : frame_.height / 50.0);
  for (double v = std::ceil(low / step - 1e-9) * step; v <= high + 1e-9 * step; v += step)
    ticks.push_back({v, number(v, step)});
  return ticks;
}

void Plot::drawGrid() {
  for (int axis = 0; axis < 2; ++axis) {
    for (const Tick& tick : ticks(axis)) {
      Eigen::Vector2d at = axes_.low;
      at[axis] = tick.value;
      const Eigen::Vector2d p = pixel(at);
      const cv::Size box = sizeOf(tick.text, 0.45);
      if (axis == 0) {
        const int x = cvRound(p.x());
        cv::line(image_, {x, frame_.y}, {x, frame_.br().y}, ink::kFaint, 1);
        write(image_, tick.text, {x - box.width / 2, frame_.br().y + 20}, 0.45, ink::kBlack);
      } else {
        const int y = cvRound(p.y());
        cv::line(image_, {frame_.x, y}, {frame_.br().x, y}, ink::kFaint, 1);
        write(image_, tick.text, {frame_.x - box.width - 8, y + box.height / 2}, 0.45, ink::kBlack);
      }
    }
  }
}

void Plot::line(const std::vector<Eigen::Vector2d>& points, const Line& line) {
  remember(line.name, line.colour, line.dashed ? 1 : 0);
  cv::Mat inside = image_(frame_);
  const std::size_t n = points.size(), segments = line.closed ? n : (n > 0 ? n - 1 : 0);
  double walked = 0.0;  // pixels, so that the dash pattern continues across short segments
  for (std::size_t i = 0; i < segments; ++i) {
    const Eigen::Vector2d a = pixel(points[i]), b = pixel(points[(i + 1) % n]);
    const double length = (b - a).norm();
    if (!line.dashed) {
      cv::line(inside, fine(points[i]), fine(points[(i + 1) % n]), line.colour, line.width, cv::LINE_AA,
               kShift);
      continue;
    }
    constexpr double kDash_px = 7.0;
    for (double s = 0.0; s < length;) {
      const double phase = std::fmod(walked + s, 2.0 * kDash_px);
      const double step = std::min(length - s, (phase < kDash_px ? kDash_px : 2.0 * kDash_px) - phase + 1e-6);
      const auto at = [&](double along) { return fineOf(a + (b - a) * (along / length)); };
      if (phase < kDash_px)
        cv::line(inside, at(s), at(s + step), line.colour, line.width, cv::LINE_AA, kShift);
      s += step;
    }
    walked += length;
  }
}

void Plot::area(const Polygon& polygon, const cv::Scalar& colour, double opacity, const std::string& name) {
  remember(name, colour, 3);
  if (polygon.size() < 3) return;
  std::vector<cv::Point> points;
  for (const auto& p : polygon) points.push_back(fine(p));
  cv::Mat inside = image_(frame_), over = inside.clone();
  cv::fillPoly(over, std::vector<std::vector<cv::Point>>{points}, colour, cv::LINE_AA, kShift);
  cv::addWeighted(over, opacity, inside, 1.0 - opacity, 0.0, inside);
}

void Plot::dot(const Eigen::Vector2d& at, const cv::Scalar& colour, int radius_px, const std::string& name) {
  remember(name, colour, 2);
  cv::Mat inside = image_(frame_);
  cv::circle(inside, fine(at), radius_px << kShift, colour, cv::FILLED, cv::LINE_AA, kShift);
}

void Plot::circle(const Eigen::Vector2d& at, double radius, const Line& line) {
  Line closed = line;
  closed.closed = true;
  this->line(circlePolygon(at, radius, 180), closed);
}

void Plot::arrow(const Eigen::Vector2d& from, const Eigen::Vector2d& to, const Line& line) {
  this->line({from, to}, line);
  const Eigen::Vector2d a = pixel(from), b = pixel(to), along = b - a;
  if (along.norm() < 1.0) return;
  const Eigen::Vector2d unit = along.normalized(), side(-unit.y(), unit.x());
  const double head = std::min(9.0, 0.6 * along.norm());
  cv::Mat inside = image_(frame_);
  std::vector<cv::Point> points;
  for (const Eigen::Vector2d& p : {b, Eigen::Vector2d(b - head * unit + 0.45 * head * side),
                                   Eigen::Vector2d(b - head * unit - 0.45 * head * side)}) {
    points.emplace_back(cvRound((p.x() - frame_.x) * (1 << kShift)),
                        cvRound((p.y() - frame_.y) * (1 << kShift)));
  }
  cv::fillPoly(inside, std::vector<std::vector<cv::Point>>{points}, line.colour, cv::LINE_AA, kShift);
}

void Plot::bar(double x, double low, double high, const cv::Scalar& colour) {
  const Eigen::Vector2d a = pixel({x, low}), b = pixel({x, high});
  const auto stroke = [&](double u0, double v0, double u1, double v1) {
    cv::line(image_, {cvRound(u0), cvRound(v0)}, {cvRound(u1), cvRound(v1)}, colour, 1, cv::LINE_AA);
  };
  stroke(a.x(), a.y(), b.x(), b.y());
  for (const Eigen::Vector2d& end : {a, b}) stroke(end.x() - 5, end.y(), end.x() + 5, end.y());
}

void Plot::words(const std::string& text, const Eigen::Vector2d& at, const cv::Scalar& colour, int up_px,
                 double size) {
  const cv::Size box = sizeOf(text, size);
  const Eigen::Vector2d p = pixel(at);
  const cv::Point from(cvRound(p.x()) - box.width / 2, cvRound(p.y()) + box.height / 2 - up_px);
  if (!frame_.contains(from + cv::Point(box.width / 2, 0))) return;
  write(image_, text, from, size, ink::kPaper, 4);
  write(image_, text, from, size, colour, 1);
}

void Plot::body(const Polygon& outline_in_map, const Eigen::Vector2d& at, double theta_rad,
                const cv::Scalar& colour) {
  area(outline_in_map, colour, 0.25);
  Line edge{colour, 2, false, true, ""};
  line(outline_in_map, edge);
  double reach = 0.05;
  for (const auto& p : outline_in_map) reach = std::max(reach, (p - at).norm());
  const Eigen::Vector2d ahead(std::cos(theta_rad), std::sin(theta_rad));
  arrow(at - 0.4 * reach * ahead, at + 0.95 * reach * ahead, {colour, 2, false, false, ""});
}

void Plot::drawLegend() {
  if (legend_.empty()) return;
  int width = 0;
  for (const Entry& entry : legend_) width = std::max(width, sizeOf(entry.name, 0.45).width);
  const int line = 20;
  const cv::Rect box = emptiest(image_, frame_, {width + 50, line * static_cast<int>(legend_.size()) + 10});
  cv::Mat under = image_(box);
  under = 0.15 * under + 0.85 * cv::Mat(under.size(), under.type(), ink::kPaper);
  cv::rectangle(image_, box, ink::kGrey, 1);
  int y = box.y + 18;
  for (const Entry& entry : legend_) {
    const int x = box.x + 8;
    if (entry.kind == 0) cv::line(image_, {x, y - 4}, {x + 26, y - 4}, entry.colour, 2, cv::LINE_AA);
    if (entry.kind == 1) {
      for (int k = 0; k < 3; ++k)
        cv::line(image_, {x + 10 * k, y - 4}, {x + 10 * k + 5, y - 4}, entry.colour, 2, cv::LINE_AA);
    }
    if (entry.kind == 2) cv::circle(image_, {x + 13, y - 4}, 4, entry.colour, cv::FILLED, cv::LINE_AA);
    if (entry.kind == 3) cv::rectangle(image_, {x + 4, y - 10}, {x + 22, y + 1}, entry.colour, cv::FILLED);
    write(image_, entry.name, {x + 34, y}, 0.45, ink::kBlack);
    y += line;
  }
}

cv::Mat Plot::image() {
  cv::rectangle(image_, frame_, ink::kGrey, 1);
  write(image_, axes_.title, {frame_.x, frame_.y - 18}, 0.62, ink::kBlack);
  const cv::Size x_size = sizeOf(axes_.x_label, 0.5);
  write(image_, axes_.x_label, {frame_.x + (frame_.width - x_size.width) / 2, frame_.br().y + 46}, 0.5,
        ink::kBlack);
  const cv::Size y_size = sizeOf(axes_.y_label, 0.5);
  cv::Mat words(y_size.height + 12, y_size.width + 4, CV_8UC3, ink::kPaper), turned;
  write(words, axes_.y_label, {2, y_size.height + 4}, 0.5, ink::kBlack);
  cv::rotate(words, turned, cv::ROTATE_90_COUNTERCLOCKWISE);
  const int top = std::max(0, frame_.y + (frame_.height - turned.rows) / 2);
  const cv::Rect place = cv::Rect(6, top, turned.cols, turned.rows) & cv::Rect({}, image_.size());
  turned({0, 0, place.width, place.height}).copyTo(image_(place));
  drawLegend();
  return image_;
}

cv::Mat beside(const std::vector<cv::Mat>& pictures, const std::vector<std::string>& captions) {
  constexpr int kGap = 12, kHead = 34;
  const int height = pictures.front().rows;
  std::vector<cv::Mat> scaled;
  int width = kGap;
  for (const cv::Mat& picture : pictures) {
    cv::Mat one = picture;
    if (picture.rows != height) {
      const double scale = static_cast<double>(height) / picture.rows;
      cv::resize(picture, one, {cvRound(picture.cols * scale), height}, 0, 0, cv::INTER_AREA);
    }
    scaled.push_back(one);
    width += one.cols + kGap;
  }
  cv::Mat all(height + kHead + kGap, width, CV_8UC3, ink::kPaper);
  int x = kGap;
  for (std::size_t i = 0; i < scaled.size(); ++i) {
    scaled[i].copyTo(all(cv::Rect(x, kHead, scaled[i].cols, height)));
    if (i < captions.size()) write(all, captions[i], {x + 2, kHead - 11}, 0.6, ink::kBlack);
    x += scaled[i].cols + kGap;
  }
  return all;
}

cv::Mat stacked(const std::vector<cv::Mat>& rows) {
  std::vector<cv::Mat> scaled;
  for (const cv::Mat& row : rows) {
    cv::Mat one = row;
    if (row.cols != rows.front().cols) {
      const double scale = static_cast<double>(rows.front().cols) / row.cols;
      cv::resize(row, one, {rows.front().cols, cvRound(row.rows * scale)}, 0, 0, cv::INTER_AREA);
    }
    scaled.push_back(one);
  }
  cv::Mat all;
  cv::vconcat(scaled, all);
  return all;
}

void save(const std::string& path, const cv::Mat& picture) {
  bool done = false;
  try {
    done = cv::imwrite(path, picture);
  } catch (const cv::Exception& error) {
    throw std::runtime_error(path + ": " + error.err);
  }
  if (!done) throw std::runtime_error(path + ": cannot be written");
}

}  // namespace omnifleet::experiments
