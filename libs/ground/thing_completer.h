#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "ground/band_completer.h"
#include "ground/bit_mask.h"
#include "ground/labelling.h"
#include "ground/shade_filter.h"
#include "ground/side_completer.h"
#include "ground/top_completer.h"
#include "lens/camera.h"

namespace omnifleet::ground {

/// Completes things of which but a part differs plainly from the floor: tops of sides (SideCompleter), sides
/// of tops (TopCompleter), what lies between bands (BandCompleter).
class ThingCompleter {
 public:
  ThingCompleter(const lens::Camera& camera, cv::Size image);

  /// Where things are written to.
  struct Found {
    BitMask& bits;     ///< pixels of things
    cv::Mat1b& cells;  ///< 1 where some are
  };
  /// What differs from the floor.
  struct Raw {
    const BitMask& mask;               ///< not yet despeckled
    const BitMask& cleaned;            ///< the same despeckled
    const std::vector<Blob>* regions;  ///< of it; nullptr: not known, or walls are among them
  };
  /// @param shade of this frame; what is undecided after all is told it
  /// @return whether anything has changed
  bool complete(const SideCompleter::Frame& frame, const Raw& raw, ShadeFilter& shade, const Found& found);
  /// Nothing of the last frame is left, but that there were such things.
  void clear() { rough_.clear(); }
  /// Is the region one whose outline was told by its top and what its sides look like on the whole?
  bool isRough(const Blob& region) const;

  /// The camera's, pixels.
  const cv::Point2f& foot() const { return sides_.foot(); }

 private:
  void completeTops(const ShadeFilter::Frame& frame, ShadeFilter& shade, const Found& found);
  static void replace(const Blob& part, const std::vector<Run>& whole, const Found& found);
  void completeBands(const SideCompleter::Frame& frame, const Raw& raw, const ShadeFilter& shade);
  static void set(const std::vector<Run>& runs, const Found& found);

  SideCompleter sides_;
  TopCompleter tops_;
  BandCompleter bands_;
  std::vector<const Blob*> settled_;  ///< regions that tops_ has spoken of
  std::vector<const Blob*> alone_;    ///< regions of which nothing but a top is known
  std::vector<cv::Point> rough_;      ///< what is left of each lies there
  std::vector<const Blob*> banded_;   ///< regions that may be bands of things
  std::vector<Run> between_;          ///< of bands, with what lies between them
  int remembered_ = 0;  ///< frames, this one too, for which it is known that there are such things
};

}  // namespace omnifleet::ground
