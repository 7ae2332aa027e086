#include "ground/sharp_outline.h"

#include <algorithm>
#include <cmath>

#include "ground/appearance_class.h"

namespace omnifleet::ground {

namespace {

constexpr int kStep_px = 3;  // distance to each side of an outline at which the brightness is compared
constexpr int kFaceStep_px = 2,
              kInFace_px = 9;  // the same for a face, and the distance inside it at which the face is sampled
constexpr float kLeastFaceDepth = 0.15f;  // minimum difference of a face from the floor
constexpr float kSharpShare = 0.5f;  // minimum height of an edge, as a share of the difference from the floor

/// Faces of an object differ in brightness. Is the edge as high as the difference from the floor farther
/// inside? Where light fades, the difference continues to increase.
template <typename GainBeside>
bool isStepOfFace(const GainBeside& gainBeside, bool down) {
  const float ahead = gainBeside(kFaceStep_px, down), behind = gainBeside(-kFaceStep_px, down);
  const int in_px = std::abs(ahead - 1.0f) > std::abs(behind - 1.0f) ? kInFace_px : -kInFace_px;
  const float depth = std::abs(gainBeside(in_px, down) - 1.0f);
  return depth >= kLeastFaceDepth && std::abs(ahead - behind) >= kSharpShare * depth;
}

}  // namespace

OutlineSharpness sharpnessOfOutline(const Blob& blob, const FloorFrame& frame, const cv::Mat1b& appearances) {
  float depth = 0.0f;
  int grey = 0;
  for (const Run& run : blob.runs) {
    for (int x = run.begin; x < run.end; ++x) {
      if (!isGrey(appearances(run.row, x))) continue;
      depth += std::abs(gainOf(appearances(run.row, x)) - 1.0f);
      ++grey;
    }
  }
  depth /= static_cast<float>(std::max(1, grey));
  int sharp = 0, count = 0, light = 0, sharp_light = 0;
  for (const Run& run : blob.runs) {
    for (const int x : {run.begin, run.end - 1}) {
      const auto gainBeside = [&](int along_px, bool down) {
        return down ? meanGain(frame, x, run.row + along_px, 1, 0)
                    : meanGain(frame, x + along_px, run.row, 0, 1);
      };
      const auto isStep = [&](bool down) {
        const float step = std::abs(gainBeside(kStep_px, down) - gainBeside(-kStep_px, down));
        return step >= kSharpShare * depth || isStepOfFace(gainBeside, down);
      };
      const bool is_sharp = isStep(false) || isStep(true);
      const bool is_light =
          isGrey(appearances(run.row, x)) && gainOf(appearances(run.row, x)) >= 1.0f + kFaintContrast;
      sharp += is_sharp ? 1 : 0;
      light += is_light ? 1 : 0;
      sharp_light += is_sharp && is_light ? 1 : 0;
      ++count;
    }
  }
  const auto share = [](int part, int whole) {
    return static_cast<float>(part) / static_cast<float>(std::max(1, whole));
  };
  return {share(sharp, count), share(light, count), share(sharp_light, light)};
}

}  // namespace omnifleet::ground
