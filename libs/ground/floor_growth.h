#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "ground/far_floor.h"
#include "ground/floor_noise.h"
#include "ground/ground_histogram.h"

namespace omnifleet::ground {

/// Squared tolerances of what passes for floor, as fractions of the floor colour's |r|².
struct FloorTest {
  float along2, across2;
};

/// What the floor's colour may be off by: shares of its brightness, and the noise times so many added to
/// both.
struct FloorTolerance {
  double along, across;
  double noise_sigmas;
  FloorTest testFor(const cv::Vec3f& r, const FloorNoise& noise) const;
};

/// The blocks of an image that show floor: grown outward from seeds, each accepted block handing a slowly
/// adapting colour and slope of brightness on to its neighbours, so that uneven light is followed while an
/// object's edge stops the growth; markings up to a few blocks wide are stepped over. What is more like
/// that which is seen above the horizon beyond it, is of it.
class FloorGrowth {
 public:
  /// @param coverage per block, 2 where all of it may show floor. @param seeds per block, not 0 for a seed
  /// @param min_share of the seeds that fills a bin of their histogram
  /// @param all_modes whether all that fill bins are seeds, not only the commonest of them
  FloorGrowth(const cv::Mat1b& coverage, const cv::Mat1b& seeds, const FloorTolerance& tolerance,
              double min_share, bool all_modes = false);
  FloorGrowth(const FloorGrowth&) = delete;  // means_ looks into framed_means_
  FloorGrowth& operator=(const FloorGrowth&) = delete;

  /// @param far of the same blocks
  void lookFar(const FarFloor& far);
  /// To be filled before grow(): mean colour per block, in the light that there is.
  cv::Mat3f& means();
  const cv::Mat3f& means() const { return means_; }
  /// @param sectors per block the number of its colour in what grow() is given; 0 where there is none
  void lookBeyond(const cv::Mat1b& sectors);
  /// The means become what they would be in even light, until means() are filled again.
  /// @param light per block, > 0, as a share of that at the camera's foot
  void evenOut(const cv::Mat1f& light);
  bool isEvened() const { return is_evened_; }
  /// @param noise of one block's mean @param beyond colours that are no floor's (Horizon::colours())
  /// @param is_smoothed the means are CellColours that are
  /// @return false when no seed shows floor
  bool grow(const FloorNoise& noise, const std::vector<cv::Vec4f>& beyond = {}, bool is_smoothed = false);
  bool isGrown(int y, int x) const { return isGrown(numberOf(y, x)); }
  bool isGrown(int number) const { return stop_.data[number] == kGrown; }
  /// The blocks that the growth reached, in its order, by their number.
  const std::vector<int>& grown() const { return queue_; }
  int numberOf(int y, int x) const { return (y + kJump) * stride_ + x + kJump; }
  cv::Point blockAt(int number) const { return {number % stride_ - kJump, number / stride_ - kJump}; }
  /// What the block's mean was divided by.
  float lightAt(int number) const { return is_evened_ ? light_.ptr<float>()[number] : 1.0f; }
  /// Sum of the channels, in the light that there is.
  float brightnessAt(int number) const;
  /// Median step of the seeds' colour over two blocks, as a share of the brightness.
  float texture() const { return texture_; }
  int numbers() const { return static_cast<int>(framed_means_.total()); }
  /// Mean colours (BGR) by the blocks' numbers, three floats each and one more that may be read.
  const float* meansByNumber() const { return framed_means_.ptr<float>(); }
  /// By the blocks' numbers: the mean green of those that the growth reached, 0 of the others.
  void levels(std::vector<float>& by_number) const;

 private:
  static constexpr std::uint8_t kClosed = 1,
                                kGrown = 3;  ///< where growth stops: no floor can be seen; it has been there
  static constexpr int kJump = 4;  ///< blocks: a marking (grid line, joint) up to this wide is stepped over
  /// What a block hands on.
  struct Handed {
    float colour[4];  ///< the last one has no meaning
    float slope[2];   ///< relative change of the brightness per block, x and y
  };
  bool seed(const FloorNoise& noise);
  void dropOtherHues(const FloorNoise& noise);
  void dropBeyond();
  float brighten();
  float seedTexture();
  void handMeanHueOn(const FloorNoise& noise);
  void growByMeans(const FloorNoise& noise);
  void growBySmoothedHues(const FloorNoise& noise);
  template <bool kSmoothed>
  void growAll(const FloorNoise& noise);
  template <bool kSmoothed>
  void growFrom(int at, const FloorNoise& noise);
  static Handed steepened(const Handed& from, float by);
  template <typename Colour>
  FloorTest offOf(const Colour& p, const Colour& r) const;
  template <typename Colour>
  float hueGain(int at, const Colour& mean, const Colour& expected) const;
  template <typename Colour>
  bool isAtHuesEdge(int at, const Colour& colour, float across2) const;
  template <bool kSmoothed>
  bool accept(int to, const Handed& from, const FloorTest& test, float flatness, int step, int jump);

  FloorTolerance tolerance_;
  double min_share_;
  bool all_modes_;
  GroundHistogram histogram_;
  // Blocks are counted in a frame of kJump closed ones to each side, so that nothing asks where the edge is.
  int stride_;
  cv::Mat1b closed_, stop_;  ///< not 0 where growth never gets to; and where it has been
  cv::Mat1b sector_;         ///< by number, once there are any
  std::vector<cv::Vec4f> beyond_;
  cv::Vec4f of_seeds_;  ///< mean colour of the seeds that show floor, while there is anything beyond
  cv::Mat3f framed_means_, means_;
  std::vector<FarFloor::Block> far_;  ///< by number
  std::vector<Handed> handed_;
  cv::Mat1f light_;  ///< by number: what means_ were divided by
  bool is_evened_ = false;
  std::vector<int> seeds_, queue_;
  std::vector<float> sorted_;
  float texture_ = 0.0f;
};

}  // namespace omnifleet::ground
