#include <cmath>

#include "tests/experiments/fernandez/compass_range.h"
#include "tests/experiments/plot/plot.h"

namespace omnifleet::fernandez {
namespace {

namespace ink = experiments::ink;
using Points = std::vector<Eigen::Vector2d>;

constexpr int kFewest = 5;  // pairs of a bin that are drawn
const cv::Size kPanel(1100, 520);

/// One point per bin that has enough values, at its middle.
template <typename ValueOf, typename CountOf>
Points curve(const std::vector<DistanceBin>& bins, const ValueOf& valueOf, const CountOf& countOf) {
  Points points;
  for (const DistanceBin& bin : bins)
    if (countOf(bin) >= kFewest) points.emplace_back(0.5 * (bin.from_m + bin.to_m), valueOf(bin));
  return points;
}

int pairsOf(const DistanceBin& bin) {
  return bin.pairs;
}
int sureOf(const DistanceBin& bin) {
  return bin.sure;
}

experiments::Axes axesOver(const std::vector<DistanceBin>& bins, const char* title, const char* y_label,
                           double low, double high) {
  experiments::Axes axes;
  axes.title = title;
  axes.x_label = "true distance between the two images, m";
  axes.y_label = y_label;
  axes.low = {bins.front().from_m, low};
  axes.high = {bins.back().to_m, high};
  return axes;
}

void markPaper(experiments::Plot& plot, double low, double high) {
  plot.line({{kPaperRange_m, low}, {kPaperRange_m, high}},
            {ink::kBlack, 1, true, false, "0.8 m: valid up to here in the paper"});
}

cv::Mat errors(const std::vector<DistanceBin>& bins) {
  constexpr double kLow_deg = 0.05, kHigh_deg = 200.0;
  experiments::Axes axes = axesOver(bins, "Visual compass: median (solid) and 90 % (dashed) of each bin",
                                    "absolute error of the turn, degrees", kLow_deg, kHigh_deg);
  axes.log_y = true;
  experiments::Plot plot(axes, kPanel);
  markPaper(plot, kLow_deg, kHigh_deg);
  const auto draw = [&](Spread DistanceBin::*error, int (*count)(const DistanceBin&),
                        const cv::Scalar& colour, const char* name) {
    plot.line(curve(
                  bins, [&](const DistanceBin& bin) { return (bin.*error).median; }, count),
              {colour, 2, false, false, name});
    plot.line(curve(
                  bins, [&](const DistanceBin& bin) { return (bin.*error).high; }, count),
              {colour, 2, true, false, ""});
  };
  draw(&DistanceBin::literal_deg, pairsOf, ink::kOrange, "literal");
  draw(&DistanceBin::images_deg, pairsOf, ink::kGrey, "omnifleet, images alone");
  draw(&DistanceBin::omnifleet_deg, pairsOf, ink::kBlue, "omnifleet");
  draw(&DistanceBin::sure_deg, sureOf, ink::kGreen, "omnifleet, confidence of 0.9 and more");
  return plot.image();
}

cv::Mat shares(const std::vector<DistanceBin>& bins) {
  constexpr double kLow = 0.0, kHigh = 105.0;
  experiments::Plot plot(
      axesOver(bins, "Pairs whose turn is right (error below 3 degrees), and confidence of omnifleet",
               "share of the pairs, %", kLow, kHigh),
      kPanel);
  markPaper(plot, kLow, kHigh);
  const auto draw = [&](int DistanceBin::*part, int DistanceBin::*whole, const experiments::Line& line) {
    plot.line(curve(
                  bins, [&](const DistanceBin& bin) { return 100.0 * (bin.*part) / (bin.*whole); },
                  [&](const DistanceBin& bin) { return bin.*whole; }),
              line);
  };
  draw(&DistanceBin::literal_right, &DistanceBin::pairs, {ink::kOrange, 2, false, false, "literal: right"});
  draw(&DistanceBin::omnifleet_right, &DistanceBin::pairs, {ink::kBlue, 2, false, false, "omnifleet: right"});
  draw(&DistanceBin::usable, &DistanceBin::pairs,
       {ink::kPurple, 2, true, false, "confidence of 0.1 and more (usable)"});
  draw(&DistanceBin::usable_right, &DistanceBin::usable,
       {ink::kPurple, 2, false, false, "right, of these with 0.1 and more"});
  draw(&DistanceBin::sure, &DistanceBin::pairs, {ink::kGreen, 2, true, false, "confidence of 0.9 and more"});
  draw(&DistanceBin::sure_right, &DistanceBin::sure,
       {ink::kGreen, 2, false, false, "right, of these with 0.9 and more"});
  return plot.image();
}

cv::Mat differences(const std::vector<DistanceBin>& bins) {
  constexpr double kLow = 0.0, kHigh = 1.0;
  experiments::Plot plot(axesOver(bins, "Difference of the signatures: median (line) and 10 to 90 % (bars)",
                                  "D / mean norm, k1 = 64", kLow, kHigh),
                         kPanel);
  markPaper(plot, kLow, kHigh);
  const auto draw = [&](Spread DistanceBin::*difference, double shift_m, const cv::Scalar& colour,
                        const char* name) {
    Points points = curve(
        bins, [&](const DistanceBin& bin) { return (bin.*difference).median; }, pairsOf);
    for (Eigen::Vector2d& point : points) point.x() += shift_m;  // so that the bars stand side by side
    plot.line(points, {colour, 2, false, false, name});
    for (const DistanceBin& bin : bins)
      if (bin.pairs >= kFewest)
        plot.bar(0.5 * (bin.from_m + bin.to_m) + shift_m, (bin.*difference).low, (bin.*difference).high,
                 colour);
  };
  draw(&DistanceBin::literal_difference, -0.01, ink::kOrange, "literal: 64 rows near the horizon");
  draw(&DistanceBin::omnifleet_difference, 0.01, ink::kBlue, "omnifleet: 16 rows");
  return plot.image();
}

}  // namespace

void drawCompassRange(const std::vector<DistanceBin>& bins, const std::string& file) {
  experiments::save(file, experiments::stacked({errors(bins), shares(bins), differences(bins)}));
}

}  // namespace omnifleet::fernandez
