#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "markers/marker_pixels.h"
#include "markers/template_model.h"

namespace omnifleet::markers {

struct FitOptions {
  double pixel_sigma_px;  ///< px, σ of the position from an inexact lens model
  double scale_sigma;     ///< 1, σ of the size of a marker: print, height and focal length
};

/// A region after the fit.
struct FittedRegion {
  Eigen::Vector3d bgr{0.0, 0.0, 0.0};
  double visible = 0.0;  ///< share of its area inside the image and not occluded
};

/// A marker fitted to an image.
struct Fit {
  Pose2 map_from_base;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  ///< x, y, θ; right perturbation
  double scale = 1.0, scale_sigma = 0.0;                     ///< size in the image ÷ expected size
  double luma_blur_px = 0.0, chroma_blur_px = 0.0;           ///< σ, with the width of a pixel
  double rms = 0.0;      ///< 1, residual of the pixels that fit ÷ contrast
  double misfit = 0.0;   ///< share of the pixels that do not fit
  double outline = 0.0;  ///< share of the outline with contrast to the surroundings
  double visible = 0.0;  ///< share of the marker inside the image
  double metres_per_px = 0.0;
  std::vector<FittedRegion> regions;
};

/// Fits all rectangles of a marker at once to the colours of the image by least squares (Gauss–Newton). The
/// predicted image is the painter's order of the rectangles' colours on the surroundings, blurred by lens and
/// pixel. Unknowns: the pose, the scale (with a prior), the blur of luma and of chroma, the colour of each
/// rectangle. The colours enter linearly and are eliminated. Residuals of luma and of chroma, of the outline
/// and of the inner edges have a σ each, estimated from the residuals, so that each weighs as much as it can
/// be trusted. Pixels that fit no region lose their weight (occlusion).
class TemplateFit {
 public:
  TemplateFit(const lens::Camera& camera, double height_m, const Layout& layout, const ColourTable& table,
              const FitOptions& options);

  /// Fit from an approximate pose, which may be wrong by about `start_blur_px`. Empty if the fit diverges.
  std::optional<Fit> fit(const cv::Mat& bgr, const Pattern& pattern, const Pose2& start,
                         double start_blur_px);
  /// Repeats the last part of a fit with light in place of grey levels. `scale`, `blur_px`: of that fit. Only
  /// pose and covariance of the result are comparable. Empty if the fit diverges.
  std::optional<Fit> refit(const cv::Mat& bgr, const Pattern& pattern, const Pose2& start,
                           const Eigen::Vector2d& blur_px, double scale, const Tone& tone);
  /// Sets the blur at which the fit begins, from an earlier image of the camera. It saves time only.
  void expectBlur(const Eigen::Vector2d& luma_chroma_px) { expected_blur_px_ = luma_chroma_px; }

 private:
  static constexpr Eigen::Index kUnknowns = 6;  // dx, dy, dθ, log luma blur, log chroma blur, log scale
  static constexpr Eigen::Index kShared = 5;    // of them for one channel
  using Vector = Eigen::Matrix<double, kUnknowns, 1>;
  using Matrix = Eigen::Matrix<double, kUnknowns, kUnknowns>;

  struct State {
    Pose2 start_from_base;  ///< motion from the pose at which the pixels were collected
    double log_scale = 0.0;
    Eigen::Vector2d log_blur{0.0, 0.0};
    std::vector<Eigen::Vector3d> colours;  ///< luma and chroma per region
  };

  bool collect(const cv::Mat& bgr, const Pattern& pattern, const Pose2& at, double blur_px, State& state);
  bool iterate(State& state, bool free_blur, int iterations);
  void place(const State& state);
  void predict(const State& state, bool one_blur);
  void weigh();
  void eliminate(const State& state, int channel);
  bool step(State& state, bool free_blur, double& size_px);
  Fit judge(const Pose2& start, const State& state) const;
  const Coverage& coverageOf(int channel) const { return channel == 0 || one_blur_ ? luma_ : chroma_; }

  FitOptions options_;
  const Layout& layout_;
  MarkerPixels pixels_;
  TemplateModel model_;
  bool one_blur_ = true;
  Eigen::Vector2d expected_blur_px_;

  Eigen::Index count_ = 0;
  Eigen::ArrayXf u_, v_;  ///< at the current pose
  Coverage luma_, chroma_;
  Eigen::ArrayXXf residual_;                      ///< luma and chroma
  Eigen::ArrayXf trust_;                          ///< weight of each pixel, 0 to 1
  Eigen::ArrayXf outer_;                          ///< 1 for pixels that contain surroundings
  std::array<std::array<double, 2>, 2> sigma_{};  ///< of luma and chroma, inner and outer
  Eigen::ArrayXXf rows_;  ///< weighted rows of one channel: coverage, derivatives, residual
  Eigen::ArrayXf weight_;
  Matrix h_;
  Vector g_;
  std::array<Eigen::MatrixXd, 3> back_;  ///< per channel: colours − back · step
};

}  // namespace omnifleet::markers
