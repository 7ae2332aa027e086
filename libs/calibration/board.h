#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

namespace omnifleet::calibration {

/// A chessboard, counted as OpenCV does: inner corners, where four squares meet.
struct Board {
  int columns = 0, rows = 0;
  double square_m = 0.0;

  /// "9x6" → 9 columns, 6 rows. Throws options::Error; each count is at least 3, a square longer than 0.
  static Board parse(const std::string& size, double square_m);
  /// Inner corners in the board's plane, metres, row by row, in the order of findBoard().
  std::vector<Eigen::Vector2d> corners_m() const;
};

/// Sub-pixel inner corners of the board in a grey image (CV_8U), row by row; nothing where it is not found
/// whole. Boards seen by wide-angle lenses are bent and small: OpenCV's quad detector and its sector-based
/// one (Duda and Frese 2018) are tried in turn at several scales, and what they find is refined in the
/// original image (gradients orthogonal to the edges, Förstner and Gülch 1987) in a window of a third of the
/// distance to the corner's nearest neighbour, so that no other edge falls in. Deterministic.
std::optional<std::vector<Eigen::Vector2d>> findBoard(const cv::Mat& grey, const Board& board);

/// A board of nearly that size (people count squares, or miss a row) which is there where that one is not;
/// found by the quick detector alone.
std::optional<Board> findOtherSize(const cv::Mat& grey, const Board& board);

}  // namespace omnifleet::calibration
