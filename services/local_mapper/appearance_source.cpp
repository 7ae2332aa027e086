#include "local_mapper/appearance_source.h"

#include <cmath>
#include <utility>

#include "appearance/stored_signature.h"

namespace omnifleet::local_mapper {

appearance::KeyframePolicy AppearanceOptions::byDistance() {
  appearance::KeyframePolicy policy;
  policy.rule = appearance::KeyframeRule::kDistance;
  return policy;
}

AppearanceOptions AppearanceOptions::read(const options::Section& section) {
  AppearanceOptions o;
  section.read("use", o.use);
  o.places = appearance::KeyframePolicy::read(section.child("places"), byDistance());
  o.panorama = appearance::PanoramaOptions::read(section.child("panorama"));
  o.signature = appearance::SignatureOptions::read(section.child("signature"));
  o.compass = appearance::CompassOptions::read(section.child("compass"));
  section.finish();
  return o;
}

AppearanceSource::AppearanceSource(const lens::Camera& camera, const AppearanceOptions& options)
    : options_(options),
      unwrapper_(appearance::Unwrapper::fromCamera(camera, options.panorama)),
      maker_(unwrapper_, options.signature),
      compass_(options.compass) {
  appearance_.format = maker_.format();
}

const Appearance& AppearanceSource::skip() {
  previous_ns_ = 0;
  appearance_.since_ns = 0;
  appearance_.turn_rad = appearance_.turn_sigma_rad = 0.0;
  appearance_.confidence = appearance_.difference = 0.0f;
  appearance_.signature.bytes.clear();
  appearance_.signature.scale.clear();
  return appearance_;
}

bool AppearanceSource::isPlace(bool measured) const {
  if (last_place_.empty()) return true;
  appearance::KeyframePolicy policy = options_.places;
  if (policy.rule == appearance::KeyframeRule::kDistance && !measured)
    policy.rule = appearance::KeyframeRule::kDifference;
  const double difference = policy.rule == appearance::KeyframeRule::kDifference
                                ? appearance::difference(signature_, last_place_)
                                : 0.0;
  return policy.isKeyframe(images_, travelled_m_, difference);
}

const Appearance& AppearanceSource::process(TimeNs acquired_ns, const cv::Mat& image, const Motion& wheels) {
  const TimeNs since_ns = previous_ns_;
  skip();
  unwrapper_.unwrap(image, panorama_);
  maker_.compute(panorama_, signature_);
  compass_.prepare(signature_, view_);
  if (since_ns != 0) {
    appearance::TravelHint hint;
    hint.bearing_sigma_rad = -1.0;  // unknown
    if (wheels.valid && wheels.since_ns == since_ns) {
      const Pose2& way = wheels.previous_from_current;
      hint.distance_m = way.translation().norm();
      // In the frame halfway between both headings.
      if (hint.distance_m > 0) {
        hint.bearing_rad = wrapAngle(std::atan2(way.y_m, way.x_m) - 0.5 * way.theta_rad);
        hint.bearing_sigma_rad = appearance::TravelHint().bearing_sigma_rad;
      }
    }
    const appearance::CompassResult found = compass_.compare(previous_, view_, hint);
    appearance_.since_ns = since_ns;
    appearance_.turn_rad = found.turn_rad;
    appearance_.turn_sigma_rad = found.valid ? found.sigma_rad : 0.0;
    appearance_.confidence = static_cast<float>(found.confidence);
    appearance_.difference = static_cast<float>(appearance::difference(previous_signature_, signature_));
  }
  if (wheels.valid) travelled_m_ += wheels.previous_from_current.translation().norm();
  ++images_;
  if (isPlace(wheels.valid)) {
    appearance_.signature = appearance::store(signature_);
    last_place_ = signature_;
    images_ = 0;
    travelled_m_ = 0.0;
  }
  previous_ns_ = acquired_ns;
  std::swap(previous_, view_);
  std::swap(previous_signature_, signature_);
  return appearance_;
}

}  // namespace omnifleet::local_mapper
