#pragma once

#include <cstdint>
#include <vector>

#include "geometry/pose2.h"
#include "local_mapper/view_blocks.h"
#include "observation/observation.h"

namespace omnifleet::local_mapper {

/// Detects a lens that is fully occluded, whatever the occluder's appearance: within one frame the whole
/// image changes, although the robot hardly moves. A change of light keeps the structure and is not detected.
/// The occlusion ends when the former image is back, or when the image moves as the robot drives. An occluder
/// does not move in the image, so in that case the robot was kidnapped, or the light changed too much.
class SceneCut {
 public:
  /// @param blocks kept by reference
  explicit SceneCut(const ViewBlocks& blocks);

  /// Processes the frame that `blocks` has read.
  /// @param usable per block: whether it is known to show the scene
  /// @param wheels motion since the previous frame; where it is not valid, no occlusion is detected
  /// @return whether the camera is occluded
  bool update(const std::vector<std::uint8_t>& usable, const Motion& wheels);

 private:
  bool isCut();
  bool isBack();
  bool isMoving() const;
  double findChanged();
  bool isRestWhole() const;
  bool isEdge(int block, const ViewBlocks::Means& means) const;
  void remember();

  const ViewBlocks& blocks_;
  std::vector<int> tested_;                ///< usable blocks
  std::vector<std::uint8_t> has_changed_;  ///< per block
  ViewBlocks::Means scene_, occluded_;     ///< as seen last; as it was when the occluder appeared
  bool has_scene_ = false, is_occluded_ = false;
  Pose2 since_scene_, since_occluded_;  ///< motion since then
};

}  // namespace omnifleet::local_mapper
