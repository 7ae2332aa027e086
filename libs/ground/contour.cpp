#include "ground/contour.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::ground {

ContourTracer::ContourTracer(const FloorView& view, const ContourOptions& options)
    : refiner_(view, options), visited_(view.imageSize(), std::uint8_t{0}) {}

void ContourTracer::trace(const ContourFrame& frame, const Blob& blob, Contour& contour) {
  const cv::Mat1b& objects = frame.objects;
  contour.points_px.clear();
  contour.loop_begin.clear();
  contour.beside.clear();
  if (blob.runs.empty()) return;
  const std::uint8_t own = objects(blob.runs.front().row, blob.runs.front().begin);
  for (const Run& run : blob.runs) {
    if (visited_(run.row, run.begin) != 0) continue;
    bool has_above = false;  // a piece of the region begins with a run that has no pixel above it
    if (run.row > 0)
      for (int x = std::max(run.begin - 1, 0); x < std::min(run.end + 1, objects.cols) && !has_above; ++x)
        has_above = objects(run.row - 1, x) == own;
    if (!has_above) followLoop(objects, {run.begin, run.row}, contour);
  }
  for (const auto& p : marked_) visited_(p) = 0;
  marked_.clear();
  refine(frame, contour);
}

void ContourTracer::refine(const ContourFrame& frame, Contour& contour) {
  std::size_t kept = 0;
  for (std::size_t k = 0; k < contour.loop_begin.size(); ++k) {
    const std::size_t begin = contour.loop_begin[k];
    const std::size_t end =
        k + 1 < contour.loop_begin.size() ? contour.loop_begin[k + 1] : contour.points_px.size();
    Eigen::Vector2f* points = contour.points_px.data();
    std::uint8_t* beside = contour.beside.data();
    const std::size_t count = refiner_.refine(frame, points + begin, beside + begin, end - begin);
    std::copy_n(points + begin, count, points + kept);
    std::copy_n(beside + begin, count, beside + kept);
    contour.loop_begin[k] = kept;
    kept += count;
  }
  contour.points_px.resize(kept);
  contour.beside.resize(kept);
}

void ContourTracer::followLoop(const cv::Mat1b& objects, cv::Point start, Contour& contour) {
  const std::uint8_t own = objects(start);
  // Follows the pixel edges with the region on the right-hand side. Directions: 0 east, 1 south, 2 west, 3
  // north. `pixel` is the region's pixel beside the edge.
  static constexpr int kAhead[4][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
  const auto isObject = [&](int x, int y) {
    return x >= 0 && y >= 0 && x < objects.cols && y < objects.rows && objects(y, x) == own;
  };
  const auto valueAt = [&](int x, int y) {
    return x >= 0 && y >= 0 && x < objects.cols && y < objects.rows ? objects(y, x) : std::uint8_t{0};
  };
  const std::size_t begin = contour.points_px.size();
  cv::Point pixel = start;
  int direction = 0;
  double twice_area = 0.0;
  do {
    const int* ahead = kAhead[direction];
    const int left_x = ahead[1], left_y = -ahead[0];  // unit step to the left of the walk
    contour.points_px.emplace_back(static_cast<float>(pixel.x) + 0.5f * static_cast<float>(left_x),
                                   static_cast<float>(pixel.y) + 0.5f * static_cast<float>(left_y));
    contour.beside.push_back(valueAt(pixel.x + left_x, pixel.y + left_y));
    if (direction == 0) twice_area -= 2.0 * (pixel.y - 0.5);
    if (direction == 2) twice_area += 2.0 * (pixel.y + 0.5);
    if (direction == 3) {
      visited_(pixel) = 1;
      marked_.push_back(pixel);
    }
    const cv::Point ahead_right(pixel.x + ahead[0], pixel.y + ahead[1]);
    const cv::Point ahead_left(ahead_right.x + left_x, ahead_right.y + left_y);
    if (isObject(ahead_left.x, ahead_left.y)) {  // 8-connected: the diagonal neighbour belongs to the region
      pixel = ahead_left;
      direction = (direction + 3) % 4;
    } else if (isObject(ahead_right.x, ahead_right.y)) {
      pixel = ahead_right;
    } else {
      direction = (direction + 1) % 4;
    }
  } while (pixel != start || direction != 0);
  if (twice_area <= 0.0) {  // the border of a hole
    contour.points_px.resize(begin);
    contour.beside.resize(begin);
  } else {
    contour.loop_begin.push_back(begin);
  }
}

}  // namespace omnifleet::ground
