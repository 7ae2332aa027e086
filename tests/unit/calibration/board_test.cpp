#include "calibration/board.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "options/options.h"
#include "tests/unit/calibration/boards_for_tests.h"

namespace omnifleet::calibration::test {
namespace {

std::string refusal(const std::string& size, double square_m) {
  try {
    Board::parse(size, square_m);
  } catch (const options::Error& error) {
    return error.what();
  }
  return "";
}

TEST(Board, ParsesSizeOrRejectsIt) {
  const Board board = Board::parse("9x6", 0.116);
  EXPECT_EQ(board.columns, 9);
  EXPECT_EQ(board.rows, 6);
  ASSERT_EQ(board.corners_m().size(), 54u);
  EXPECT_LT((board.corners_m()[10] - Eigen::Vector2d(0.116, 0.116)).norm(), 1e-15);
  for (const char* wrong : {"9", "9x", "x6", "9x6x2", "9 by 6", "2x6", "9x101", ""})
    EXPECT_THAT(refusal(wrong, 0.1), ::testing::HasSubstr("--board")) << wrong;
  for (const double wrong : {0.0, -1.0, std::nan("")})
    EXPECT_THAT(refusal("9x6", wrong), ::testing::HasSubstr("--square-m"));
}

/// Largest distance between found and true corners. The detector may count from the other end.
double worst_px(std::vector<Eigen::Vector2d> found, const std::vector<Eigen::Vector2d>& truth) {
  if ((found.front() - truth.front()).norm() > (found.back() - truth.front()).norm())
    std::reverse(found.begin(), found.end());
  double worst = 0.0;
  for (std::size_t i = 0; i < truth.size(); ++i) worst = std::max(worst, (found[i] - truth[i]).norm());
  return worst;
}

// Corners of rendered boards, bent by a 185° lens, against the equations of the lens. In a noiseless 8-bit
// image the saddle point of a corner is found to some hundredths of a pixel. Bent edges add a little, most
// where the squares are small (9 px at 60°).
TEST(Board, FindsCornersOfRenderedBoardToSubPixel) {
  const Board board = Board::parse("7x5", 0.06);
  const lens::CameraModel model = lensModel(lens::Projection::kEquidistant);
  const auto lens = lens::Lens::make(model);
  for (const double theta_deg : {0.0, 35.0, 60.0}) {
    const Eigen::Isometry3d pose =
        boardAt(board, theta_deg * M_PI / 180.0, 0.7, 0.45, Eigen::Vector3d(0.2, -0.15, 0.3));
    const auto corners = findBoard(picture(model, board, pose), board);
    ASSERT_TRUE(corners) << theta_deg;
    EXPECT_LT(worst_px(*corners, viewOf(*lens, board, pose).corners_px), theta_deg < 50.0 ? 0.1 : 0.15)
        << theta_deg;
  }
}

TEST(Board, SuggestsSizeWhenSquaresWereCounted) {
  const Board board = Board::parse("7x5", 0.06);
  const lens::CameraModel model = lensModel(lens::Projection::kEquidistant);
  const cv::Mat image =
      picture(model, board, boardAt(board, 0.0, 0.7, 0.45, Eigen::Vector3d(0.2, -0.15, 0.3)));
  for (const char* wrong : {"8x6", "8x5", "7x6", "6x4"}) {
    const auto found = findOtherSize(image, Board::parse(wrong, 0.06));
    ASSERT_TRUE(found) << wrong;
    EXPECT_EQ(found->columns, 7) << wrong;
    EXPECT_EQ(found->rows, 5) << wrong;
  }
  EXPECT_FALSE(findOtherSize(image, Board::parse("11x9", 0.06)));
}

TEST(Board, FindsNoBoardInHalfHiddenOrEmptyImage) {
  const Board board = Board::parse("7x5", 0.06);
  const lens::CameraModel model = lensModel(lens::Projection::kEquidistant);
  cv::Mat half = picture(model, board, boardAt(board, 0.0, 0.0, 0.45, Eigen::Vector3d::Zero()));
  half(cv::Rect(half.cols / 2, 0, half.cols / 2, half.rows)) = cv::Scalar(110);
  EXPECT_FALSE(findBoard(half, board)) << "half of the board is hidden";
  EXPECT_FALSE(findBoard(cv::Mat::zeros(480, 640, CV_8U), board));
}

}  // namespace
}  // namespace omnifleet::calibration::test
