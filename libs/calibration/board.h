#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

namespace omnifleet::calibration {

/// A chessboard, counted as in OpenCV: inner corners, where four squares meet.
struct Board {
  int columns = 0, rows = 0;
  double square_m = 0.0;

  /// "9x6" → 9 columns, 6 rows. Throws options::Error unless each count is within 3 to 100 and the square is
  /// longer than 0.
  static Board parse(const std::string& size, double square_m);
  /// Inner corners in the plane of the board, metres, row by row, in the order of findBoard().
  std::vector<Eigen::Vector2d> corners_m() const;
};

/// Sub-pixel inner corners of the board in a grey image (CV_8U), row by row. Empty unless all corners are
/// found. Wide-angle lenses show boards bent and small. So OpenCV's quad detector and its sector-based
/// detector (Duda and Frese 2018) are tried in turn at several scales. The result is refined in the original
/// image (gradients orthogonal to the edges, Förstner and Gülch 1987). The window is a third of the distance
/// to the nearest corner, so that it contains no other edge. Deterministic.
std::optional<std::vector<Eigen::Vector2d>> findBoard(const cv::Mat& grey, const Board& board);

/// A board of similar size that is found where `board` is not: users often count squares, or miss a row. Uses
/// the quick detector only.
std::optional<Board> findOtherSize(const cv::Mat& grey, const Board& board);

}  // namespace omnifleet::calibration
