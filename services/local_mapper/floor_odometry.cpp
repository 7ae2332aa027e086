#include "local_mapper/floor_odometry.h"

namespace omnifleet::local_mapper {

FloorOdometryOptions FloorOdometryOptions::read(const options::Section& section) {
  FloorOdometryOptions o;
  section.read("use", o.use, {"auto", "always", "never"});
  o.alignment = ground::FloorAlignmentOptions::read(section.child("alignment"));
  section.finish();
  return o;
}

void FloorOdometry::forget() {
  alignment_.forget();
  previous_ns_.reset();
  previous_.reset();
}

FloorMotion FloorOdometry::add(TimeNs time, const cv::Mat& image, const cv::Mat1b& objects,
                               const Motion& wheels) {
  std::optional<Pose2> predicted;
  if (wheels.valid && previous_ns_ && wheels.since_ns == *previous_ns_)
    predicted = wheels.previous_from_current;
  const ground::FloorAlignment::Result& now = alignment_.add(time, image, objects, predicted);
  FloorMotion motion;
  motion.since_ns = previous_ns_.value_or(time);
  if (now.valid && previous_ns_) {
    if (now.since_ns == *previous_ns_) previous_ = Aligned{*previous_ns_, {}, now.covariance};
    motion.valid = previous_ && previous_->reference_ns == now.since_ns;
  }
  if (motion.valid) {
    const Aligned& before = *previous_;
    motion.previous_from_current = before.reference_from_base.inverse() * now.reference_from_current;
    motion.covariance =
        0.5 * composeCovariance(before.covariance, motion.previous_from_current, now.covariance);
  }
  previous_.reset();
  if (now.valid) previous_ = Aligned{now.since_ns, now.reference_from_current, now.covariance};
  previous_ns_ = time;
  return motion;
}

}  // namespace omnifleet::local_mapper
