#pragma once

#include <opencv2/core.hpp>

#include "geometry/pose2.h"
#include "lens/camera.h"
#include "tests/unit/appearance/textured_room.h"

namespace omnifleet::test {

/// A fisheye camera that looks straight down from 0.5 m above base_link and sees up to 5° above its horizon.
/// A turn of the robot turns the image about its centre.
lens::CameraModel roomCamera();

/// The image of a room: each pixel of the band between −16° and 4.5° of elevation is the mean of 2 × 2 rays
/// of TexturedRoom::grey(); the others are of one grey level.
cv::Mat1b roomImage(const TexturedRoom& room, const Pose2& map_from_base);

/// Modules of a discrete Fourier transform of averaged rows, divided by the number of columns, and its
/// phases, by the definition (Fernández et al. 2011, §III.A); frequencies 1 … `frequencies`.
struct DirectTransform {
  cv::Mat1d modules, phases;  ///< rows × frequencies; radians
};
DirectTransform transformRows(const cv::Mat1b& panorama, int rows, int frequencies);

/// Eq. 2 of 16 averaged rows and 128 modules, divided by the mean norm.
double directDifference(const cv::Mat1b& a, const cv::Mat1b& b);

}  // namespace omnifleet::test
