#pragma once

#include <string>

namespace omnifleet::fernandez {

struct Picked {
  int images = 0;
  double threshold = 0.0;  ///< of the difference of two signatures
};

/// Set 2 of the paper (§V): an image is taken when its difference from the last taken one exceeds a
/// threshold. Writes the taken images of the first robot of `recording` with its wheels and the ground truth
/// to the new recording `out`. @param images how many are wanted; the threshold that gives the nearest number
/// is searched. Throws std::runtime_error.
Picked pickByDifference(const std::string& recording, const std::string& out, int images);

}  // namespace omnifleet::fernandez
