#include "tests/experiments/fernandez/heat_map.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "tests/experiments/plot/plot.h"

namespace omnifleet::fernandez {
namespace {

namespace ink = experiments::ink;
constexpr int kCell_px = 64, kHeight_px = 44, kLeft_px = 96, kTop_px = 48, kBottom_px = 64, kRight_px = 20;

void centred(cv::Mat& image, const std::string& text, cv::Point middle, double size,
             const cv::Scalar& colour) {
  int base = 0;
  const cv::Size box = cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, size, 1, &base);
  cv::putText(image, text, {middle.x - box.width / 2, middle.y + box.height / 2}, cv::FONT_HERSHEY_SIMPLEX,
              size, colour, 1, cv::LINE_AA);
}

/// Colours from dark (0) to light (1) that grey printers keep apart.
cv::Scalar colourOf(double share) {
  cv::Mat1b level(1, 1, cv::saturate_cast<std::uint8_t>(255.0 * std::clamp(share, 0.0, 1.0)));
  cv::Mat3b colour;
  cv::applyColorMap(level, colour, cv::COLORMAP_VIRIDIS);
  return colour(0, 0);
}

}  // namespace

cv::Mat draw(const HeatMap& map) {
  const int n = static_cast<int>(map.terms.size());
  cv::Mat image(kTop_px + n * kHeight_px + kBottom_px, kLeft_px + n * kCell_px + kRight_px, CV_8UC3,
                ink::kPaper);
  const double span = std::log(map.high / map.low);
  double least = std::numeric_limits<double>::infinity();
  cv::Rect best;
  for (int row = 0; row < n; ++row) {
    // k1 grows upwards, as on an axis.
    const int y = kTop_px + (n - 1 - row) * kHeight_px;
    for (int column = 0; column < n; ++column) {
      const double value = map.values.at(static_cast<std::size_t>(row)).at(static_cast<std::size_t>(column));
      const cv::Rect cell(kLeft_px + column * kCell_px, y, kCell_px, kHeight_px);
      const double share = span > 0.0 ? std::log(std::max(value, map.low) / map.low) / span : 0.0;
      cv::rectangle(image, cell, colourOf(share), cv::FILLED);
      centred(image, fmt::format("{:.{}f}", value, map.decimals), (cell.tl() + cell.br()) / 2, 0.45,
              share > 0.6 ? ink::kBlack : ink::kPaper);
      if (value < least) {
        least = value;
        best = cell;
      }
    }
    centred(image, std::to_string(map.terms[static_cast<std::size_t>(row)]),
            {kLeft_px - 24, y + kHeight_px / 2}, 0.45, ink::kBlack);
    centred(image, std::to_string(map.terms[static_cast<std::size_t>(row)]),
            {kLeft_px + row * kCell_px + kCell_px / 2, kTop_px + n * kHeight_px + 14}, 0.45, ink::kBlack);
  }
  if (map.frame_least) cv::rectangle(image, best, ink::kOrange, 3);
  centred(image, map.title, {image.cols / 2, kTop_px / 2}, 0.6, ink::kBlack);
  centred(image, map.x_label, {kLeft_px + n * kCell_px / 2, image.rows - 18}, 0.5, ink::kBlack);
  centred(image, map.y_label, {28, kTop_px + n * kHeight_px / 2}, 0.5, ink::kBlack);
  return image;
}

}  // namespace omnifleet::fernandez
