#pragma once

#include <cstdint>
#include <vector>

#include "geometry/pose2.h"
#include "local_mapper/view_blocks.h"
#include "observation/observation.h"

namespace omnifleet::local_mapper {

/// A lens that is covered as a whole, whatever the cover looks like: within one frame all of the picture
/// becomes another, though the robot hardly moved. Another light does not do that: it leaves the structure.
/// It ends when the former picture is back, or when the picture moves as the robot drives, as no cover's
/// does: then the robot was carried off, or the light changed beyond recognition.
class SceneCut {
 public:
  /// @param blocks are kept by reference
  explicit SceneCut(const ViewBlocks& blocks);

  /// Looks at the frame that `blocks` has read.
  /// @param usable one each block: whether it is known to show the world
  /// @param wheels since the frame before; where they are not valid nothing is told
  /// @return whether the camera is covered
  bool look(const std::vector<std::uint8_t>& usable, const Motion& wheels);

 private:
  bool isCut();
  bool isBack();
  bool isMoving() const;
  double findChanged();
  bool isRestWhole() const;
  bool isEdge(int block, const ViewBlocks::Means& means) const;
  void remember();

  const ViewBlocks& blocks_;
  std::vector<int> looked_at_;             ///< usable blocks
  std::vector<std::uint8_t> has_changed_;  ///< one each
  ViewBlocks::Means world_, covered_;      ///< as seen last, and as it was when the cover came up
  bool has_world_ = false, is_covered_ = false;
  Pose2 since_world_, since_covered_;  ///< driven
};

}  // namespace omnifleet::local_mapper
