#pragma once

#include <cstddef>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>

#include "dataset/dataset.h"
#include "observation/observation.h"

namespace omnifleet::dataset {

enum class Colour { kGrey, kBgr };

/// Metadata of one frame. The pixels are written to the caller's Mat.
struct FrameInfo {
  TimeNs time_ns = 0;
  std::uint32_t sequence = 0;  ///< index in data.csv, in the folder, or in the video
  FrameState state = FrameState::kOk;
  std::string fault;  ///< description of the problem; empty if kOk
  std::string where;  ///< file or device; for a video, file and frame if the frame has a fault
};

/// A source of frames. Frames are decoded one at a time, on demand.
class FrameSource {
 public:
  virtual ~FrameSource() = default;

  /// Reads the next frame. False at the end. If `image` already has the size and type of the frame, its
  /// pixels are written in place and its data pointer does not change; it may wrap memory of another owner,
  /// e.g. a loan. If `image` is empty, it is allocated. In every state except kOk the pixels are unspecified;
  /// size and memory are unchanged. States: kMissing, kUnreadable (also a truncated JPEG), kWrongSize,
  /// kEmpty, kOutOfOrder (time not after that of the latest frame).
  virtual bool next(cv::Mat& image, FrameInfo& info) = 0;

  /// Total number of frames; 0 if unknown.
  virtual std::size_t size() const = 0;

  /// What the user should know about the source, for example doubtful times; empty if nothing new.
  virtual std::string takeNotice() { return {}; }
};

/// Size that every frame must have. Zeros: the first readable frame determines it.
struct FrameSize {
  int width_px = 0, height_px = 0;
};

/// Opens a stream of a dataset. The frame size is that of its calibration.
std::unique_ptr<FrameSource> openStream(const ImageStream& stream, Colour colour);

/// Opens all images (png, jpg, jpeg, bmp, tif, tiff, pgm, ppm) of a directory, sorted by name. Frame i has
/// the time start + i·period. Throws options::Error when the folder cannot be opened or contains no image.
std::unique_ptr<FrameSource> openFolder(const std::string& folder, Colour colour, FrameSize size,
                                        TimeNs period_ns, TimeNs start_ns = 0);

/// Opens a video file through OpenCV. The first frame has the time `start_ns`; the others follow at the times
/// of the container, which need not be evenly spaced. A time that does not follow its predecessor is not
/// used: from there on the frames are 1/fps apart, with the rate of the file, or `fallback_fps` if the file
/// does not state it. Throws options::Error when the file cannot be opened.
std::unique_ptr<FrameSource> openVideo(const std::string& path, Colour colour, FrameSize size,
                                       TimeNs start_ns = 0, double fallback_fps = 30.0);

/// Copies a captured BGR or grey frame into `image` under the rules of FrameSource::next(). Zeros in `size`
/// become the size of the frame.
FrameState copyFrame(const cv::Mat& captured, Colour colour, FrameSize& size, cv::Mat& image,
                     std::string& fault);

/// Throws options::Error that names data.csv, the first file and its fault if a stream names files and none
/// can be read as a frame, or if no stream names a file and the recording has neither laser nor observations.
/// Decodes each stream up to its first good frame. Programs that replay a recording call it before they
/// start.
void checkFrames(const Dataset& dataset);

/// Decodes one file into `image` under the rules of FrameSource::next(). `buffer` is reused between calls.
/// `fault` is as in FrameInfo.
FrameState decodeImage(const std::string& path, Colour colour, FrameSize size,
                       std::vector<unsigned char>& buffer, cv::Mat& image, std::string& fault);

}  // namespace omnifleet::dataset
