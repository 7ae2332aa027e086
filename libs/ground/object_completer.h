#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "ground/band_completer.h"
#include "ground/bit_mask.h"
#include "ground/labelling.h"
#include "ground/shadow_filter.h"
#include "ground/side_completer.h"
#include "ground/top_completer.h"
#include "lens/camera.h"

namespace omnifleet::ground {

/// Completes objects of which only a part differs clearly from the floor: the tops of sides (SideCompleter),
/// the sides of tops (TopCompleter) and the space between bands (BandCompleter).
class ObjectCompleter {
 public:
  ObjectCompleter(const lens::Camera& camera, cv::Size image);

  /// Output masks.
  struct Found {
    BitMask& bits;     ///< pixels of objects
    cv::Mat1b& cells;  ///< 1 for cells with such pixels
  };
  /// Pixels that differ from the floor.
  struct Raw {
    const BitMask& mask;               ///< before despeckling
    const BitMask& cleaned;            ///< after despeckling
    const std::vector<Blob>* regions;  ///< of `cleaned`; nullptr: unknown, or walls are among them
  };
  /// @param shadow of this frame; receives the regions that become undecided
  /// @return whether anything has changed
  bool complete(const SideCompleter::Frame& frame, const Raw& raw, ShadowFilter& shadow, const Found& found);
  /// Forgets the regions of the last frame, but not that such objects exist.
  void clear() { rough_.clear(); }
  /// Was the outline of the region reconstructed from its top and the mean appearance of its sides?
  bool isRough(const Blob& region) const;

  /// The camera foot, pixels.
  const cv::Point2f& foot() const { return sides_.foot(); }

 private:
  void completeTops(const ShadowFilter::Frame& frame, ShadowFilter& shadow, const Found& found);
  static void replace(const Blob& part, const std::vector<Run>& whole, const Found& found);
  void completeBands(const SideCompleter::Frame& frame, const Raw& raw, const ShadowFilter& shadow);
  static void set(const std::vector<Run>& runs, const Found& found);

  SideCompleter sides_;
  TopCompleter tops_;
  BandCompleter bands_;
  std::vector<const Blob*> settled_;   ///< regions that tops_ has completed or left undecided
  std::vector<const Blob*> top_only_;  ///< regions of which only the top face is segmented
  std::vector<cv::Point> rough_;       ///< a pixel of each completed top
  std::vector<const Blob*> banded_;    ///< regions that may be bands of objects
  std::vector<Run> between_;           ///< pixels of bands and of the space between them
  int remembered_ = 0;                 ///< frames, including this one, for which such objects are remembered
};

}  // namespace omnifleet::ground
