#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "tests/experiments/fernandez/study.h"

namespace omnifleet::fernandez {

struct HeatMap {
  std::string title, x_label, y_label;
  std::vector<int> terms;        ///< of both axes
  Surface values;                ///< rows along y, columns along x
  double low = 0.0, high = 1.0;  ///< ends of the colours, logarithmic; low > 0
  int decimals = 3;              ///< of the numbers in the cells
  bool frame_least = true;       ///< a frame around the least value
};

/// A table of numbers on colours, small values dark.
cv::Mat draw(const HeatMap& map);

}  // namespace omnifleet::fernandez
