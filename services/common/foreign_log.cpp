#include "common/foreign_log.h"

#include <cstdlib>
#include <opencv2/core/utils/logger.hpp>

namespace omnifleet::services {

void silenceImageLibraries() {
  if (std::getenv("OPENCV_LOG_LEVEL") == nullptr)
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  ::setenv("OPENCV_LOG_LEVEL", "SILENT", 0);
  ::setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", 0);
}

}  // namespace omnifleet::services
