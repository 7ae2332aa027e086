#include "flow/pyramid.h"

#include <opencv2/imgproc.hpp>

namespace omnifleet::flow {

void Pyramid::build(const cv::Mat& image) {
  if (image.channels() == 3)
    cv::cvtColor(image, levels_[0], cv::COLOR_BGR2GRAY);
  else
    image.copyTo(levels_[0]);
  for (std::size_t k = 1; k < levels_.size(); ++k) cv::pyrDown(levels_[k - 1], levels_[k]);
}

}  // namespace omnifleet::flow
