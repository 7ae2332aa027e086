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
      0.965;  ///< 1, below this solidity a silhouette may hold several objects (limit for one polygon: 0.94)
  double hue_step = 0.11;   ///< 1, distance of (r, g)/(r + g + b) between the colours of two objects
  double min_share = 0.08;  ///< 1, minimum share of the region's area for an object
  int min_area_px = 40;     ///< pixels, minimum area of an object
  double min_gain = 0.5;    ///< 1, minimum share of the region's concavity that the split removes
  double min_outline =
      0.2;  ///< 1, minimum share of an object's outline that borders on the floor; less is a mark
  static SplitOptions read(const options::Section& section);
};

/// Splits a region that shows several objects which occlude one another, by their colours. Chromaticity does
/// not change with light and shadow. A part counts as an object only if some of its outline borders on the
/// floor. Marks and labels stay with the object that carries them.
class BlobSplitter {
 public:
  BlobSplitter(cv::Size image, const SplitOptions& options);

  /// @param image BGR8; grey images are never split
  /// @return the parts, empty if the region is one object; valid until the next call
  const std::vector<Blob>& split(const cv::Mat& image, const Blob& blob);

  /// Each pixel of a part holds 1 + the part's index, all other pixels 0. Valid until the next call.
  const cv::Mat1b& mask() const { return mask_; }

 private:
  static constexpr int kBins = 32;
  static constexpr int kMaxColours = 4;
  struct Colour {  ///< shares of red and green
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
  cv::Rect rect_;                    ///< bounding rectangle of the region
  cv::Mat1b inside_, class_;         ///< size of the rectangle; classes count from 1
  cv::Mat1b canvas_;                 ///< size of the rectangle, 1 within a hull
  cv::Mat1b masked_, spare_;         ///< with a margin: pixels of the region, else 0; classes
  std::vector<std::uint16_t> sums_;  ///< of one row
  std::vector<std::uint8_t> line_, counts_;
  cv::Mat1f red_, green_;  ///< chromaticity shares, size of the rectangle
  std::vector<std::int32_t> bins_;
  std::vector<float> nearest_;  ///< squared distances for one row
  std::array<int, kBins * kBins> histogram_{};
  struct Mode {
    int count;  ///< pixels in a bin and its neighbours
    Colour colour;
  };
  std::vector<Mode> modes_;
  std::vector<Colour> colours_;
  struct ClassRun {
    int begin, end;
    std::size_t piece;  ///< during the search: an earlier run of the same piece, or the run itself
    std::uint8_t colour;
  };
  std::vector<ClassRun> runs_;
  std::vector<std::size_t> row_begin_;
  struct Piece {
    int area = 0, outside = 0;  ///< pixels; edges towards pixels outside the region
    int shared = 0;             ///< edges towards other pieces
  };
  int& shared(std::size_t piece, std::size_t other) { return shared_[piece * pieces_.size() + other]; }
  std::vector<Piece> pieces_;
  std::vector<int> shared_;          ///< common edges of each pair of pieces
  std::vector<std::size_t> joined_;  ///< piece that each one was merged into; its own index if none
  // Storage of the matrices above.
  std::vector<std::uint8_t> inside_store_, class_store_, masked_store_, spare_store_, canvas_store_;
  std::vector<float> red_store_, green_store_;
  std::vector<cv::Point> corners_, hull_;  ///< in coordinates of the rectangle
  std::vector<Blob> parts_;
};

}  // namespace omnifleet::ground
