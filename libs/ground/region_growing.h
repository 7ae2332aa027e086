#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "ground/far_floor.h"
#include "ground/floor_noise.h"
#include "ground/ground_histogram.h"

namespace omnifleet::ground {

/// Squared tolerances of the floor's colour, as fractions of its |r|².
struct FloorTest {
  float along2, across2;
};

/// Tolerances of the floor's colour: shares of its brightness, plus noise_sigmas times the noise for both.
struct FloorTolerance {
  double along, across;
  double noise_sigmas;
  FloorTest testFor(const cv::Vec3f& r, const FloorNoise& noise) const;
};

/// The blocks of an image that show floor. Regions grow outward from seeds. Each accepted block propagates a
/// slowly adapting colour and brightness gradient to its neighbours. Uneven light is thus followed, while the
/// edge of an object stops the growing. Markings up to a few blocks wide are skipped. A block that resembles
/// what is visible above the horizon on its bearing more than the floor is not accepted.
class RegionGrowing {
 public:
  /// @param coverage per block, 2 where all of it may show floor @param seeds per block, not 0 for a seed
  /// @param min_share of the seeds that fills a bin of their histogram
  /// @param all_modes whether all filled bins are seeds, not only those of the most common mode
  RegionGrowing(const cv::Mat1b& coverage, const cv::Mat1b& seeds, const FloorTolerance& tolerance,
                double min_share, bool all_modes = false);
  RegionGrowing(const RegionGrowing&) = delete;  // means_ is a part of framed_means_
  RegionGrowing& operator=(const RegionGrowing&) = delete;

  /// @param far for the same blocks
  void useFarFloor(const FarFloor& far);
  /// Mean colour per block in the actual light; fill it before grow().
  cv::Mat3f& means();
  const cv::Mat3f& means() const { return means_; }
  /// @param sectors per block, the index of its colour in the `beyond` of grow(); 0 where there is none
  void setBeyondSectors(const cv::Mat1b& sectors);
  /// Converts the means to even light, until means() are filled again.
  /// @param light per block, > 0, as a share of the light at the camera foot
  void evenOut(const cv::Mat1f& light);
  bool isEvened() const { return is_evened_; }
  /// @param noise of one block's mean @param beyond colours that are not the floor's (Horizon::colours())
  /// @param is_smoothed whether the means are smoothed CellColours
  /// @return false when no seed shows floor
  bool grow(const FloorNoise& noise, const std::vector<cv::Vec4f>& beyond = {}, bool is_smoothed = false);
  bool isGrown(int y, int x) const { return isGrown(numberOf(y, x)); }
  bool isGrown(int number) const { return stop_.data[number] == kGrown; }
  /// Numbers of the blocks that were reached, in order of acceptance.
  const std::vector<int>& grown() const { return queue_; }
  int numberOf(int y, int x) const { return (y + kJump) * stride_ + x + kJump; }
  cv::Point blockAt(int number) const { return {number % stride_ - kJump, number / stride_ - kJump}; }
  /// Divisor of the block's mean.
  float lightAt(int number) const { return is_evened_ ? light_.ptr<float>()[number] : 1.0f; }
  /// Sum of the channels in the actual light.
  float brightnessAt(int number) const;
  /// Median change of the seeds' colour over two blocks, as a share of the brightness.
  float texture() const { return texture_; }
  int numbers() const { return static_cast<int>(framed_means_.total()); }
  /// Mean colours (BGR) by block number, three floats each, and one more that may be read.
  const float* meansByNumber() const { return framed_means_.ptr<float>(); }
  /// By block number: mean green of the reached blocks, 0 for the others.
  void levels(std::vector<float>& by_number) const;

 private:
  static constexpr std::uint8_t kClosed = 1,
                                kGrown = 3;  ///< values of stop_: no floor is visible there; already reached
  static constexpr int kJump = 4;  ///< blocks: a marking (grid line, joint) up to this wide is skipped
  /// State that a block propagates to its neighbours.
  struct Propagated {
    float colour[4];  ///< the last one is unused
    float slope[2];   ///< relative change of the brightness per block, x and y
  };
  bool seed(const FloorNoise& noise);
  void dropOtherHues(const FloorNoise& noise);
  void dropBeyond();
  float brighten();
  float seedTexture();
  void propagateMeanHue(const FloorNoise& noise);
  void growByMeans(const FloorNoise& noise);
  void growBySmoothedHues(const FloorNoise& noise);
  template <bool kSmoothed>
  void growAll(const FloorNoise& noise);
  template <bool kSmoothed>
  void growFrom(int at, const FloorNoise& noise);
  static Propagated steepened(const Propagated& from, float by);
  template <typename Colour>
  FloorTest offOf(const Colour& p, const Colour& r) const;
  template <typename Colour>
  float hueGain(int at, const Colour& mean, const Colour& expected) const;
  template <typename Colour>
  bool isAtHuesEdge(int at, const Colour& colour, float across2) const;
  template <bool kSmoothed>
  bool accept(int to, const Propagated& from, const FloorTest& test, float flatness, int step, int jump);

  FloorTolerance tolerance_;
  double min_share_;
  bool all_modes_;
  GroundHistogram histogram_;
  // Blocks are numbered in an image with kJump closed blocks added on each side, so that no bounds are
  // checked.
  int stride_;
  cv::Mat1b closed_, stop_;  ///< not 0 where growing never arrives; stop_: also where it has arrived
  cv::Mat1b sector_;         ///< by block number; empty without sectors
  std::vector<cv::Vec4f> beyond_;
  cv::Vec4f of_seeds_;  ///< mean colour of the seeds that show floor; valid while beyond_ is not empty
  cv::Mat3f framed_means_, means_;
  std::vector<FarFloor::Block> far_;  ///< by block number
  std::vector<Propagated> propagated_;
  cv::Mat1f light_;  ///< by block number: divisor of means_
  bool is_evened_ = false;
  std::vector<int> seeds_, queue_;
  std::vector<float> sorted_;
  float texture_ = 0.0f;
};

}  // namespace omnifleet::ground
