#pragma once

#include <cstddef>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>

#include "dataset/dataset.h"
#include "observation/observation.h"

namespace omnifleet::dataset {

enum class Colour { kGrey, kBgr };

/// One frame's facts; the pixels go into the caller's Mat.
struct FrameInfo {
  TimeNs time_ns = 0;
  std::uint32_t sequence = 0;  ///< index in data.csv, in the folder or in the video
  FrameState state = FrameState::kOk;
  std::string fault;  ///< what is wrong; empty when kOk
  std::string where;  ///< the file, the device, or (where it has a fault) the video and frame
};

/// Where frames come from. One frame at a time, decoded on demand.
class FrameSource {
 public:
  virtual ~FrameSource() = default;

  /// The next frame; false at the end. When `image` already has the frame's size and type (it may wrap
  /// foreign memory, e.g. a loan) the pixels are written in place and its data pointer does not change; when
  /// it is empty it is allocated. In every state but kOk its pixels are unspecified, its size and memory
  /// unchanged. States: kMissing, kUnreadable (also a truncated JPEG), kWrongSize, kEmpty, kOutOfOrder (time
  /// not after the latest frame's).
  virtual bool next(cv::Mat& image, FrameInfo& info) = 0;

  /// Frames in all; 0 where unknown (a device).
  virtual std::size_t size() const = 0;
};

/// Size that every frame must have; zeros: the first readable frame decides.
struct FrameSize {
  int width_px = 0, height_px = 0;
};

/// A stream of a dataset; sizes are those of its calibration.
std::unique_ptr<FrameSource> openStream(const ImageStream& stream, Colour colour);

/// All images (png, jpg, jpeg, bmp, tif, tiff, pgm, ppm) of a directory, sorted by name; frame i at start +
/// i·period. Throws options::Error when the folder cannot be opened or holds no image.
std::unique_ptr<FrameSource> openFolder(const std::string& folder, Colour colour, FrameSize size,
                                        TimeNs period_ns, TimeNs start_ns = 0);

/// A video file through OpenCV; frame i at start + i/fps of the file (`fallback_fps` where it does not say).
/// Throws options::Error when it cannot be opened.
std::unique_ptr<FrameSource> openVideo(const std::string& path, Colour colour, FrameSize size,
                                       TimeNs start_ns = 0, double fallback_fps = 30.0);

/// A camera device ("0" or "/dev/video0") through OpenCV, stamped with the system clock when a frame arrives.
/// It asks the device for `size`. Throws options::Error naming the device when it cannot be opened. A frame
/// that does not come is kMissing; after 50 in a row the source ends.
std::unique_ptr<FrameSource> openDevice(const std::string& device, Colour colour, FrameSize size);

/// Decodes one file into `image` under the rules of FrameSource::next(). `buffer` is reused between calls;
/// `fault` as in FrameInfo.
FrameState decodeImage(const std::string& path, Colour colour, FrameSize size,
                       std::vector<unsigned char>& buffer, cv::Mat& image, std::string& fault);

}  // namespace omnifleet::dataset
