#pragma once

#include <opencv2/core/mat.hpp>

#include "appearance/compass.h"
#include "appearance/keyframe_policy.h"
#include "appearance/panorama.h"
#include "appearance/signature.h"
#include "lens/camera.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::local_mapper {

struct AppearanceOptions {
  bool use = true;
  /// Which frames become places. Without wheels the rule `distance` is `difference`.
  appearance::KeyframePolicy places = byDistance();
  appearance::PanoramaOptions panorama;
  appearance::SignatureOptions signature;
  appearance::CompassOptions compass;
  /// Keys: use; sections places, panorama, signature, compass.
  static AppearanceOptions read(const options::Section& section);
  static appearance::KeyframePolicy byDistance();
};

/// The appearance of each frame of one camera: its panorama as a Fourier signature, the turn since the frame
/// before by the visual compass, and the decision whether the frame becomes a place (Fernández et al. 2011).
class AppearanceSource {
 public:
  /// Throws options::Error if the band of the panorama is not in the image.
  AppearanceSource(const lens::Camera& camera, const AppearanceOptions& options);

  /// @param image as the camera delivers it @param wheels motion since the frame before, if it was measured
  /// @return valid until the next call
  const Appearance& process(TimeNs acquired_ns, const cv::Mat& image, const Motion& wheels);
  /// A frame without a valid image. The next one is compared with none.
  const Appearance& skip();

  const cv::Mat1b& panorama() const { return panorama_; }

 private:
  bool isPlace(bool measured) const;

  AppearanceOptions options_;
  appearance::Unwrapper unwrapper_;
  appearance::SignatureMaker maker_;
  appearance::Compass compass_;
  cv::Mat1b panorama_;
  appearance::Signature signature_, last_place_;
  appearance::Compass::View view_, previous_;
  appearance::Signature previous_signature_;
  TimeNs previous_ns_ = 0;
  int images_ = 0;          ///< since the last place, …
  double travelled_m_ = 0;  ///< … and the way by the wheels
  Appearance appearance_;
};

}  // namespace omnifleet::local_mapper
