#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/labelling.h"
#include "options/options.h"

namespace omnifleet::flow {

struct HarrisOptions {
  double k = 0.04;        ///< Choi eq. 2
  double m = 0.03;        ///< threshold as a fraction of the strongest response (0.3 in the paper)
  bool per_label = true;  ///< strongest response of the label, so that dim objects keep their corners; false:
                          ///< of the frame, as in the paper
  double sigma_px = 1.5;  ///< pixels: Gaussian window W
  int max_per_label = 20;        ///< strongest corners kept per label
  double min_distance_px = 5.0;  ///< pixels between the corners of a label
  int halve_from_px = 4000;  ///< area of a label (pixels) from which half the resolution is used, because it
                             ///< shows more corners than are kept; 0: never. Only with per_label
  static HarrisOptions read(const options::Section& section);
};

struct Corner {
  Eigen::Vector2f pixel;
  float response = 0.0f;
  std::size_t blob = 0;  ///< index into the blobs
};

/// Harris corners (Choi eq. 2) with a Gaussian window, only within labelled regions.
class Harris {
 public:
  explicit Harris(const HarrisOptions& options);

  /// @param grey CV_8UC1
  /// @return corners by blob, the strongest first in each; valid until the next call
  const std::vector<Corner>& detect(const cv::Mat1b& grey, const std::vector<ground::Blob>& blobs);
  /// Corners in blobs[which[i]]; Corner::blob is i.
  /// @param half the image at half its size (cv::pyrDown), for large blobs; may be empty
  const std::vector<Corner>& detect(const cv::Mat1b& grey, const cv::Mat1b& half,
                                    const std::vector<ground::Blob>& blobs,
                                    const std::vector<std::size_t>& which);

  /// O(x, y) of eq. 2 over a rectangle of the image. Central differences, in grey levels per pixel.
  void response(const cv::Mat1b& grey, const cv::Rect& rect, cv::Mat1f& response);

 private:
  void findSpans(const ground::Blob& blob, const cv::Rect& rect);
  static std::vector<float> gaussian(double sigma_px);
  void respond(const cv::Mat1b& grey, const cv::Rect& rect, const std::vector<float>& kernel,
               cv::Mat1f& response);
  void takeProducts(const cv::Mat1b& grey, const cv::Rect& rect, int radius, int y, const cv::Range& columns);
  void findIn(const cv::Mat1b& grey, const ground::Blob& blob, std::size_t index, int scale);
  const ground::Blob& halved(const ground::Blob& blob);
  void candidates(const ground::Blob& blob, std::size_t index, const cv::Rect& rect, int scale);
  void select(std::size_t blobs);

  HarrisOptions options_;
  std::vector<float> kernel_, half_kernel_;  ///< W
  cv::Mat1f xx_, xy_, yy_, row_, response_;
  std::vector<cv::Range> spans_;  ///< columns of each row of a rectangle where the response is requested
  std::vector<int> peaks_;        ///< of one row
  ground::Blob halved_;
  std::vector<Corner> candidates_, corners_;
  std::vector<float> strongest_;
  std::vector<std::size_t> all_;
};

}  // namespace omnifleet::flow
