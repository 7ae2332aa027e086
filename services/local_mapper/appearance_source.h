#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>

#include "appearance/compass.h"
#include "appearance/panorama.h"
#include "appearance/signature.h"
#include "lens/camera.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::local_mapper {

/// Which frames become places, i.e. nodes of the topological map.
enum class PlacePolicy {
  kEvery,       ///< each n-th frame; n = 1: Fernández et al. 2011, set 1
  kDistance,    ///< after a distance by the wheels; without wheels as kDifference
  kDifference,  ///< when the signature differs from that of the last place; set 2
};

struct AppearanceOptions {
  bool use = true;
  PlacePolicy places = PlacePolicy::kDistance;
  int every = 1;            ///< frames, policy every
  double distance_m = 0.1;  ///< m, policy distance
  double turn_rad = 0.5;    ///< rad, likewise: at the latest after this turn
  double difference = 0.2;  ///< 1, policy difference: distance of the signatures, divided by their mean norm
  appearance::PanoramaOptions panorama;
  appearance::SignatureOptions signature;
  appearance::CompassOptions compass;
  /// Keys: use, places (every, distance, difference), every, distance_m, turn_rad, difference; sections
  /// panorama, signature, compass.
  static AppearanceOptions read(const options::Section& section);
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
  bool isPlace(const Motion& wheels) const;

  AppearanceOptions options_;
  appearance::Unwrapper unwrapper_;
  appearance::SignatureMaker maker_;
  appearance::Compass compass_;
  cv::Mat1b panorama_;
  appearance::Signature signature_, last_place_;
  appearance::Compass::View view_, previous_;
  appearance::Signature previous_signature_;
  TimeNs previous_ns_ = 0;
  int frames_since_place_ = 0;
  double way_m_ = 0.0, turn_rad_ = 0.0;  ///< since the last place
  Appearance appearance_;
};

}  // namespace omnifleet::local_mapper
