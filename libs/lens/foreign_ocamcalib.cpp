// calib_results.txt of OCamCalib (exportData): five lines of numbers, each below a comment.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <sstream>

#include "lens/foreign.h"

namespace omnifleet::lens {
namespace {

/// The lines of numbers of a text in which every other line is blank or a comment. Empty for any other text.
std::vector<std::vector<double>> numberLines(const std::string& text) {
  std::vector<std::vector<double>> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) {
    const std::size_t first = line.find_first_not_of(" \t\r");
    if (first == std::string::npos || line[first] == '#') continue;
    std::istringstream words(line);
    std::vector<double> numbers;
    for (std::string word; words >> word;) {
      char* end = nullptr;
      numbers.push_back(std::strtod(word.c_str(), &end));
      if (*end != '\0') return {};
    }
    lines.push_back(std::move(numbers));
  }
  return lines;
}

double horner(const std::vector<double>& coefficients, double x) {
  double value = 0.0;
  for (std::size_t i = coefficients.size(); i-- > 0;) value = value * x + coefficients[i];
  return value;
}

/// The file states the polynomial and its inverse. They must agree where both are used: up to half of the
/// short side.
void checkInverse(const std::string& path, const std::vector<double>& direct,
                  const std::vector<double>& inverse, double radius_px) {
  constexpr double kAgree = 0.02;  // of the radius; OCamCalib's own fit of the inverse is within 1 px
  for (int i = 1; i <= 10; ++i) {
    const double rho = radius_px * i / 10.0;
    const double found = horner(inverse, std::atan2(horner(direct, rho), rho));
    if (std::abs(found - rho) <= std::max(2.0, kAgree * radius_px)) continue;
    throw options::Error(fmt::format(
        "{}: the inverse polynomial gives a radius of {:.1f} px where the polynomial has {:.1f} px; one of "
        "them is damaged or in another order",
        path, found, rho));
  }
}

}  // namespace

/// [n, ss0 … ] [m, inverse …] [row, column] [c, d, e] [height, width]
bool isOcamCalib(const Document& document) {
  const auto lines = numberLines(document.text);
  const auto counted = [](const std::vector<double>& line) {
    return line.size() > 2 && line[0] == static_cast<double>(line.size() - 1);
  };
  return lines.size() == 5 && counted(lines[0]) && counted(lines[1]) && lines[2].size() == 2 &&
         lines[3].size() == 3 && lines[4].size() == 2;
}

ForeignLens readOcamCalib(const Document& document) {
  const auto lines = numberLines(document.text);
  for (std::size_t line = 0; line < lines.size(); ++line) {
    for (std::size_t i = 0; i < lines[line].size(); ++i) {
      if (std::isfinite(lines[line][i])) continue;
      throw options::Error(
          fmt::format("{}: value {} of the numbers below comment {} is {}, but every number must be finite; "
                      "calibrate again",
                      document.path, i + 1, line + 1, lines[line][i]));
    }
  }
  ForeignLens lens;
  lens.path = document.path;
  lens.format = "OCamCalib";
  lens.family = Family::kOcam;
  lens.stated_by = "calib_results.txt of OCamCalib";
  lens.distortion.assign(lines[0].begin() + 1, lines[0].end());
  const std::vector<double> direct = lens.distortion;
  const std::vector<double> inverse(lines[1].begin() + 1, lines[1].end());
  lens.distortion.insert(lens.distortion.end(), lines[3].begin(), lines[3].end());
  lens.principal_point_px = {lines[2][1], lines[2][0]};
  lens.height_px = static_cast<int>(lines[4][0]);
  lens.width_px = static_cast<int>(lines[4][1]);
  if (lens.height_px < 1 || lens.width_px < 1)
    throw options::Error(document.path + ": the last line must give height and width of the image");
  checkInverse(document.path, direct, inverse, 0.5 * std::min(lens.height_px, lens.width_px));
  return lens;
}

}  // namespace omnifleet::lens
