#include "calibration/board.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "options/options.h"

namespace omnifleet::calibration {
namespace {

enum class Detector { kQuads, kQuickQuads, kSectors };

/// Detectors, and the long side (px) to which the image is scaled for each; 0: the image as it is. The cost
/// grows with the area, and the filters are designed for squares of some ten pixels. The sector detector
/// takes minutes on large images. So does the quad detector on an enlarged image that shows part of a board
/// (at the rim of a fisheye lens). There it runs only if a fast check finds enough squares.
constexpr std::pair<Detector, int> kTries[] = {{Detector::kQuads, 0},
                                               {Detector::kSectors, 0},
                                               {Detector::kSectors, 1000},
                                               {Detector::kQuickQuads, 1000},
                                               {Detector::kQuickQuads, 2000}};
constexpr int kLargest_px = 1500;  // largest side for the sector detector

bool detect(const cv::Mat& grey, const Board& board, Detector detector, std::vector<cv::Point2f>& corners) {
  const cv::Size size(board.columns, board.rows);
  if (detector != Detector::kSectors) {
    return cv::findChessboardCorners(grey, size, corners,
                                     cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE |
                                         (detector == Detector::kQuickQuads ? cv::CALIB_CB_FAST_CHECK : 0));
  }
  return cv::findChessboardCornersSB(grey, size, corners,
                                     cv::CALIB_CB_EXHAUSTIVE | cv::CALIB_CB_NORMALIZE_IMAGE);
}

float nearestNeighbour_px(const std::vector<cv::Point2f>& corners, std::size_t i) {
  float nearest = std::numeric_limits<float>::infinity();
  for (std::size_t k = 0; k < corners.size(); ++k) {
    if (k != i)
      nearest = std::min(nearest, std::hypot(corners[k].x - corners[i].x, corners[k].y - corners[i].y));
  }
  return nearest;
}

std::vector<Eigen::Vector2d> refined(const cv::Mat& grey, const std::vector<cv::Point2f>& corners) {
  const cv::TermCriteria stop(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 60, 1e-3);
  std::vector<Eigen::Vector2d> result;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const int half_px = std::clamp(static_cast<int>(nearestNeighbour_px(corners, i) / 3.0f), 2, 8);
    std::vector<cv::Point2f> one{corners[i]};
    cv::cornerSubPix(grey, one, {half_px, half_px}, {-1, -1}, stop);
    result.emplace_back(one[0].x, one[0].y);
  }
  return result;
}

/// The detectors may count from either end; rows remain rows.
std::optional<std::vector<Eigen::Vector2d>> findAt(const cv::Mat& grey, const Board& board, int side_px,
                                                   Detector detector) {
  const double scale = side_px == 0 ? 1.0 : static_cast<double>(side_px) / std::max(grey.cols, grey.rows);
  cv::Mat scaled = grey;
  if (scale != 1.0)
    cv::resize(grey, scaled, {}, scale, scale, scale < 1.0 ? cv::INTER_AREA : cv::INTER_CUBIC);
  std::vector<cv::Point2f> corners;
  if (!detect(scaled, board, detector, corners)) return std::nullopt;
  // resize() keeps the outer edges of the border pixels, so pixel centres move by half a pixel.
  const auto original = [scale](float x) { return static_cast<float>((x + 0.5) / scale - 0.5); };
  for (cv::Point2f& corner : corners) corner = {original(corner.x), original(corner.y)};
  return refined(grey, corners);
}

}  // namespace

Board Board::parse(const std::string& size, double square_m) {
  Board board;
  char rest = 0;
  if (std::sscanf(size.c_str(), "%dx%d%c", &board.columns, &board.rows, &rest) != 2)
    throw options::Error("--board: '" + size + "' must be COLSxROWS, counting inner corners");
  if (std::min(board.columns, board.rows) < 3 || std::max(board.columns, board.rows) > 100)
    throw options::Error("--board: '" + size + "' must have 3 to 100 inner corners each way");
  if (!(square_m > 0.0 && std::isfinite(square_m))) throw options::Error("--square-m: must be positive");
  board.square_m = square_m;
  return board;
}

std::vector<Eigen::Vector2d> Board::corners_m() const {
  std::vector<Eigen::Vector2d> corners;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) corners.emplace_back(column * square_m, row * square_m);
  }
  return corners;
}

std::optional<std::vector<Eigen::Vector2d>> findBoard(const cv::Mat& grey, const Board& board) {
  const int side_px = std::max(grey.cols, grey.rows);
  for (const auto& [detector, wanted_px] : kTries) {
    if (detector == Detector::kSectors && (wanted_px != 0 ? wanted_px : side_px) > kLargest_px) continue;
    if (wanted_px != 0 && std::abs(wanted_px - side_px) < side_px / 10)
      continue;  // already tried at this size
    auto corners = findAt(grey, board, wanted_px, detector);
    if (corners) return corners;
  }
  return std::nullopt;
}

std::optional<Board> findOtherSize(const cv::Mat& grey, const Board& board) {
  constexpr int kQuick_px = 1000, kLeast = 3;
  constexpr std::pair<int, int> kMore[] = {{-1, -1}, {-1, 0}, {0, -1}, {1, 1}, {1, 0}, {0, 1}};
  const int side_px = std::max(grey.cols, grey.rows) > kQuick_px ? kQuick_px : 0;
  for (const auto& [columns, rows] : kMore) {
    Board other = board;
    other.columns += columns, other.rows += rows;
    if (std::min(other.columns, other.rows) < kLeast) continue;
    if (findAt(grey, other, side_px, Detector::kQuickQuads)) return other;
  }
  return std::nullopt;
}

}  // namespace omnifleet::calibration
