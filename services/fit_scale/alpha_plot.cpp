#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "dataset/atomic_file.h"
#include "fit_scale/fit_scale_run.h"

namespace omnifleet::fit_scale {
namespace {

const cv::Scalar kRed(40, 40, 200), kBlue(190, 80, 30), kGrey(130, 130, 130), kBlack(40, 40, 40),
    kLight(225, 225, 225);
const cv::Size kSize(800, 600);
constexpr int kLeft_px = 80, kRight_px = 30, kTop_px = 50, kBottom_px = 70;

/// Axes of the picture: α over d_r.
struct Axes {
  double low_px, high_px, low_alpha, high_alpha;

  cv::Point at(double robot_px, double alpha) const {
    const double x = (robot_px - low_px) / (high_px - low_px),
                 y = (alpha - low_alpha) / (high_alpha - low_alpha);
    return {cvRound(kLeft_px + x * (kSize.width - kLeft_px - kRight_px)),
            cvRound(kSize.height - kBottom_px - y * (kSize.height - kTop_px - kBottom_px))};
  }
};

/// Round step for about six ticks.
double tickStep(double span) {
  const double raw = span / 6.0, power = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double factor : {1.0, 2.0, 5.0})
    if (factor * power >= raw) return factor * power;
  return 10.0 * power;
}

void write(cv::Mat& image, const std::string& text, const cv::Point& at, const cv::Scalar& colour = kBlack) {
  cv::putText(image, text, at, cv::FONT_HERSHEY_SIMPLEX, 0.5, colour, 1, cv::LINE_AA);
}

void drawAxes(cv::Mat& image, const Axes& axes) {
  const double step_px = tickStep(axes.high_px - axes.low_px),
               step = tickStep(axes.high_alpha - axes.low_alpha);
  for (double d = std::ceil(axes.low_px / step_px) * step_px; d <= axes.high_px; d += step_px) {
    cv::line(image, axes.at(d, axes.low_alpha), axes.at(d, axes.high_alpha), kLight);
    write(image, fmt::format("{:g}", d), axes.at(d, axes.low_alpha) + cv::Point(-12, 22));
  }
  for (double a = std::ceil(axes.low_alpha / step) * step; a <= axes.high_alpha; a += step) {
    cv::line(image, axes.at(axes.low_px, a), axes.at(axes.high_px, a), kLight);
    write(image, fmt::format("{:.2f}", a), axes.at(axes.low_px, a) + cv::Point(-50, 5));
  }
  cv::rectangle(image, axes.at(axes.low_px, axes.high_alpha), axes.at(axes.high_px, axes.low_alpha), kBlack);
  write(image, "distance d_r seen by the robot [px]", {kSize.width / 2 - 130, kSize.height - 20});
  write(image, "alpha = d_c / d_r", {10, 25});
}

template <class Alpha>
void drawCurve(cv::Mat& image, const Axes& axes, double from_px, double to_px, const Alpha& alpha,
               const cv::Scalar& colour) {
  constexpr int kSteps = 200;
  for (int i = 0; i < kSteps; ++i) {
    const double d = from_px + (to_px - from_px) * i / kSteps,
                 e = std::min(to_px, from_px + (to_px - from_px) * (i + 1) / kSteps);
    const auto a = alpha(d), b = alpha(e);
    if (a && b) cv::line(image, axes.at(d, *a), axes.at(e, *b), colour, 2, cv::LINE_AA);
  }
}

}  // namespace

void drawAlpha(const distance_vector::ScaleFit& fit, const std::string& path) {
  const auto& pairs = fit.pairs();
  const auto& printed = distance_vector::paperTable();
  Axes axes{fit.minPx(), fit.maxPx(), 1e9, -1e9};
  for (const auto& pair : pairs) {
    axes.low_alpha = std::min(axes.low_alpha, pair.alpha());
    axes.high_alpha = std::max(axes.high_alpha, pair.alpha());
  }
  const double margin_px = 0.05 * (axes.high_px - axes.low_px),
               margin = std::max(0.02, 0.12 * (axes.high_alpha - axes.low_alpha));
  axes.low_px -= margin_px;
  axes.high_px += margin_px;
  axes.low_alpha -= margin;
  axes.high_alpha += margin;
  cv::Mat image(kSize, CV_8UC3, cv::Scalar::all(255));
  drawAxes(image, axes);
  const cv::Rect inside(axes.at(axes.low_px, axes.high_alpha), axes.at(axes.high_px, axes.low_alpha));
  cv::Mat clipped = image.clone();
  drawCurve(clipped, axes, std::max(axes.low_px, printed.front().robot_px),
            std::min(axes.high_px, printed.back().robot_px), distance_vector::paperAlpha, kGrey);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const cv::Point at = axes.at(pairs[i].robot_px, pairs[i].alpha());
    if (i > 0)
      cv::line(clipped, axes.at(pairs[i - 1].robot_px, pairs[i - 1].alpha()), at, kRed, 1, cv::LINE_AA);
    cv::circle(clipped, at, 4, kRed, -1, cv::LINE_AA);
  }
  drawCurve(
      clipped, axes, fit.minPx(), fit.maxPx(), [&](double d) { return fit.alpha(d); }, kBlue);
  clipped(inside).copyTo(image(inside));
  const int x = kLeft_px + 15;
  write(image, "pairs", {x, kTop_px + 20}, kRed);
  write(image, fmt::format("fit, degree {}", fit.degree()), {x, kTop_px + 40}, kBlue);
  write(image, "polynomial of Ahmed et al. 2013, eq. 1", {x, kTop_px + 60}, kGrey);
  dataset::AtomicFile file(path);
  bool written = false;
  try {
    written = cv::imwrite(file.temporaryPath(), image);
  } catch (const cv::Exception&) {
    written = false;  // unknown extension
  }
  if (!written)
    throw std::runtime_error(path + ": cannot write this picture; use the extension .png or .jpg");
  file.commit();
}

}  // namespace omnifleet::fit_scale
