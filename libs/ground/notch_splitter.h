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
  double max_solidity = 0.93;  ///< 1, of the region in the image: more convex ones are one thing
  double min_gain = 0.6;       ///< 1, share of the region's concavity that must be gone between the parts
  double min_share = 0.06;     ///< 1, of the region's area, that a part must have
  int min_area_px = 40;        ///< pixels, likewise
  static NotchOptions read(const options::Section& section);
};

/// Takes a region apart where its outline is drawn in, as where two things of one colour touch in the image
/// or stand before one another: from notch to notch, or across a neck, along the chord that leaves the most
/// convex parts; loops that merely touch part there. Which of two stands in front is not told by this, nor
/// where exactly they meet: the outline along the chord is neither's.
class NotchSplitter {
 public:
  NotchSplitter(const FloorView& view, const NotchOptions& options);

  /// @param contour of the blob, as ContourTracer traced it
  /// @return the parts, none where the region is one thing; valid until the next call
  const std::vector<Blob>& split(const Blob& blob, const Contour& contour);

  /// Each pixel of a part holds 1 + its index, everything else 0; until the next call.
  const cv::Mat1b& mask() const { return mask_; }

 private:
  static constexpr std::size_t kMaxParts = 4;
  struct Loop {
    std::vector<cv::Point2f> points;
    double area = 0.0, hull_area = 0.0;
    double notches() const { return hull_area - area; }
  };
  struct Notch {
    std::size_t at;  ///< point of the loop
    float depth;     ///< pixels under the hull's edge
  };

  void takeLoops(const Contour& contour);
  void measure(Loop& loop);
  double notches() const;
  bool cutWorst(double least_area);
  void findNotches(const Loop& loop);
  /// Best chord from the notches found, as two indices of points; false where none pays.
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
