#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/labelling.h"
#include "options/options.h"

namespace omnifleet::ground {

struct SplitOptions {
  bool enabled = true;
  double max_solidity =
      0.965;  ///< 1, silhouettes less convex than this may be several things (as one polygon: 0.94)
  double hue_step = 0.11;    ///< 1, distance of (r, g)/(r + g + b) between the colours of two things
  double min_share = 0.08;   ///< 1, of the region's area, that a thing must have
  int min_area_px = 40;      ///< pixels, likewise
  double min_gain = 0.5;     ///< 1, share of the region\'s concavity that must be gone between the parts
  double min_outline = 0.2;  ///< 1, of its own outline, that must border on the floor: else it is a mark
  static SplitOptions read(const options::Section& section);
};

/// Takes a region apart that shows several things one before the other, by their colours: chromaticity does
/// not change with light and shade. Only what has an outline of its own towards the floor is a thing; marks
/// and labels stay with what they are on.
class BlobSplitter {
 public:
  BlobSplitter(cv::Size image, const SplitOptions& options);

  /// @param image BGR8; grey images are never split
  /// @return the parts, none where the region is one thing; valid until the next call
  const std::vector<Blob>& split(const cv::Mat& image, const Blob& blob);

  /// Each pixel of a part holds 1 + its index, everything else 0; until the next call.
  const cv::Mat1b& mask() const { return mask_; }

 private:
  static constexpr int kBins = 32;
  static constexpr int kMaxColours = 4;
  struct Colour {  ///< share of red and of green
    float r, g;
  };

  void gather(const cv::Mat& image, const Blob& blob);
  void findColours(int area);
  void assign(const Blob& blob);
  void takeMajority();
  void findPieces();
  void findRuns();
  template <typename Visit>
  void forTouchingRows(Visit visit);
  std::size_t leader(std::size_t run);
  void measureBorders();
  void addRun(const Run& run, std::size_t part);
  void mergeSmall(int area);
  bool mergeOne(int area);
  void write(const Blob& blob);
  bool isMoreConvex(const Blob& blob);
  void paintHull(const Blob& blob);
  int countNotches() const;
  void clearMask();

  SplitOptions options_;
  cv::Mat1b mask_;
  cv::Rect rect_;                    ///< of the region
  cv::Mat1b inside_, class_;         ///< of the rectangle; classes from 1 on
  cv::Mat1b canvas_;                 ///< of the rectangle, 1 within a hull
  cv::Mat1b masked_, spare_;         ///< with a margin: the region's pixels, else 0; classes
  std::vector<std::uint16_t> sums_;  ///< of a row
  std::vector<std::uint8_t> line_, counts_;
  cv::Mat1f red_, green_;  ///< shares; of the rectangle
  std::vector<std::int32_t> bins_;
  std::vector<float> nearest_;  ///< squared distances of a row
  std::array<int, kBins * kBins> histogram_{};
  struct Mode {
    int count;  ///< pixels in a bin and around
    Colour colour;
  };
  std::vector<Mode> modes_;
  std::vector<Colour> colours_;
  struct ClassRun {
    int begin, end;
    std::size_t piece;  ///< while they are being found: a run of the same piece before it, or itself
    std::uint8_t colour;
  };
  std::vector<ClassRun> runs_;
  std::vector<std::size_t> row_begin_;
  struct Piece {
    int area = 0, outside = 0;  ///< pixels, edges towards what is not of the region
    int shared = 0;             ///< edges towards other pieces
  };
  int& shared(std::size_t piece, std::size_t other) { return shared_[piece * pieces_.size() + other]; }
  std::vector<Piece> pieces_;
  std::vector<int> shared_;          ///< edges between each two of them
  std::vector<std::size_t> joined_;  ///< the piece that each has been merged into; itself: none
  // What the matrices above lie in.
  std::vector<std::uint8_t> inside_store_, class_store_, masked_store_, spare_store_, canvas_store_;
  std::vector<float> red_store_, green_store_;
  std::vector<cv::Point> corners_, hull_;  ///< of the rectangle
  std::vector<Blob> parts_;
};

}  // namespace omnifleet::ground
