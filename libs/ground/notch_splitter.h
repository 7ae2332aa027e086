#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "ground/contour.h"
#include "ground/floor_view.h"
#include "ground/labelling.h"
#include "options/options.h"

namespace omnifleet::ground {

struct NotchOptions {
  bool enabled = true;
  double max_solidity = 0.93;  ///< 1, solidity of the region in the image above which it is one object
  double min_gain = 0.6;       ///< 1, minimum share of the region's concavity that the split removes
  double min_share = 0.06;     ///< 1, minimum share of the region's area per part
  int min_area_px = 40;        ///< pixels, minimum area per part
  static NotchOptions read(const options::Section& section);
};

/// Splits a region at concavities of its outline, as they occur where two objects of one colour touch in the
/// image or overlap. It cuts from notch to notch, or across a neck, along the chord that leaves the most
/// convex parts. Loops that merely touch are separated there. The split does not determine which object is in
/// front or where exactly they meet: the outline along the chord belongs to neither.
class NotchSplitter {
 public:
  NotchSplitter(const FloorView& view, const NotchOptions& options);

  /// @param contour of the blob, as traced by ContourTracer
  /// @return the parts; none where the region is one object; valid until the next call
  const std::vector<Blob>& split(const Blob& blob, const Contour& contour);

  /// Each pixel of a part holds 1 + the index of the part, all others 0. Valid until the next call.
  const cv::Mat1b& mask() const { return mask_; }

 private:
  static constexpr std::size_t kMaxParts = 4;
  struct Loop {
    std::vector<cv::Point2f> points;
    double area = 0.0, hull_area = 0.0;
    double notches() const { return hull_area - area; }
  };
  struct Notch {
    std::size_t at;  ///< index of the point in the loop
    float depth;     ///< pixels below the edge of the hull
  };

  void takeLoops(const Contour& contour);
  void measure(Loop& loop);
  double notches() const;
  bool cutWorst(double least_area);
  void findNotches(const Loop& loop);
  /// Finds the best chord between the notches. @param from, to indices of its end points, output
  /// @return false where no chord gains enough
  bool findChord(const Loop& loop, double least_area, std::size_t& from, std::size_t& to);
  double gainOf(const Loop& loop, double least_area, std::size_t from, std::size_t to);
  void part(const Loop& loop, std::size_t from, std::size_t to, Loop& first, Loop& second);
  void write(const Blob& blob);
  void paint(const cv::Rect& rect);
  static void add(Blob& part, const Run& run, int label);
  void clearMask();

  const FloorView* view_;
  NotchOptions options_;
  cv::Mat1b mask_;
  std::vector<Loop> loops_;
  Loop first_, second_;
  std::vector<int> hull_;
  std::vector<cv::Point2f> hull_points_;
  std::vector<Notch> found_;
  std::vector<cv::Point> corners_;
  cv::Mat1b canvas_;
  std::vector<Blob> parts_;
};

}  // namespace omnifleet::ground
