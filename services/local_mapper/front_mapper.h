#pragma once

#include <string>
#include <vector>

#include "distance_vector/distance_vector.h"
#include "lens/camera.h"
#include "local_mapper/frame_check.h"
#include "observation/error_code.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::local_mapper {

/// Local maps of a forward camera (Ahmed et al. 2013 §2.1): the distance vector fills scan and boundary.
/// There are no objects; what ends the floor is an obstacle, as with a laser. The literal method of the paper
/// knows no σ and no line through several hits: σ of its scan is 0, and it has no boundary.
/// docs/methods/distance_vector.md
class FrontMapper {
 public:
  struct Options {
    FrameCheckOptions check;
    distance_vector::Options distance_vector;

    static Options read(const options::Section& section);
  };

  /// Throws options::Error if the camera does not look at the floor.
  FrontMapper(const lens::Camera& camera, const Options& options);

  /// One frame, BGR or grey. `wheels`: motion since the frame before. The result is valid until the next
  /// call.
  const LocalMap& process(const Frame& frame, const Motion& wheels);

  /// Of the last frame: a usable image that shows no usable floor; kNone otherwise.
  const Message& fault() const { return fault_; }
  /// Seconds without a frame before the last one, if there was a gap; else 0.
  double gap_s() const { return check_.gap_s(); }
  const distance_vector::DistanceVector& distances() const { return distances_; }

 private:
  FrameCheck check_;
  bool is_literal_;
  distance_vector::DistanceVector distances_;
  cv::Mat bgr_;  ///< of a grey image
  LocalMap local_map_;
  Message fault_;
};

/// The image with the floor's boundary and the distances in red (Ahmed et al. 2013 Fig. 1d), after
/// process(image).
cv::Mat distancePicture(const FrontMapper& mapper, const cv::Mat& image);

/// Writes two pictures of the mapper's last frame: PREFIX_floor.png, the floor in white (Ahmed Fig. 1c), and
/// PREFIX_distance.png, the image with the floor's boundary in red (Fig. 1d). @return descriptions of
/// problems
std::vector<std::string> saveDistancePictures(const FrontMapper& mapper, const cv::Mat& image,
                                              const std::string& prefix);

}  // namespace omnifleet::local_mapper
