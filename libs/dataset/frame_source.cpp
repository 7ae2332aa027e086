#include "dataset/frame_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <opencv2/videoio/registry.hpp>
#include <utility>

#include "dataset/image_names.h"

namespace omnifleet::dataset {
namespace {
namespace fs = std::filesystem;

/// Frames from a list of files with times: a stream of a dataset, or a folder.
class FileSource : public FrameSource {
 public:
  FileSource(std::vector<ImageRow> rows, Colour colour, FrameSize size)
      : rows_(std::move(rows)), colour_(colour), size_(size) {}

  bool next(cv::Mat& image, FrameInfo& info) override {
    if (position_ >= rows_.size()) return false;
    const ImageRow& row = rows_[position_++];
    info.time_ns = row.time_ns;
    info.sequence = row.sequence;
    info.where = row.path.empty() ? fmt::format("row {}", row.sequence) : row.path;
    if (row.time_ns <= latest_ns_) {
      info.state = FrameState::kOutOfOrder;
      info.fault = fmt::format("time {} is not after the latest time {}", row.time_ns, latest_ns_);
      return true;
    }
    latest_ns_ = row.time_ns;
    if (row.path.empty()) {
      info.state = FrameState::kMissing;
      info.fault = "has no file name";
      return true;
    }
    info.state = decodeImage(row.path, colour_, size_, buffer_, image, info.fault);
    if (info.state == FrameState::kOk && size_.width_px == 0) size_ = {image.cols, image.rows};
    return true;
  }

  std::size_t size() const override { return rows_.size(); }

 private:
  std::vector<ImageRow> rows_;
  Colour colour_;
  FrameSize size_;
  std::size_t position_ = 0;
  TimeNs latest_ns_ = std::numeric_limits<TimeNs>::min();
  std::vector<unsigned char> buffer_;
};

/// The one suitable backend, if OpenCV has it. Trying all of them takes seconds, and plugins of GStreamer
/// leak memory.
int backend(cv::VideoCaptureAPIs api) {
  return cv::videoio_registry::hasBackend(api) ? api : cv::CAP_ANY;
}

/// Times of the frames of a video: those of its container, which may have any distance from each other. From
/// the first time that does not follow its predecessor on, the average rate counts.
class VideoTimes {
 public:
  VideoTimes(TimeNs start_ns, double fps) : time_ns_(start_ns), period_ns_(std::llround(1e9 / fps)) {}

  /// @param container_ms time of the frame in the container
  TimeNs next(double container_ms) {
    if (!any_) {
      any_ = true;
      offset_ns_ = time_ns_ - nanoseconds(container_ms);
      return time_ns_;
    }
    const TimeNs stated_ns = offset_ns_ + nanoseconds(container_ms);
    is_average_ = is_average_ || stated_ns <= time_ns_;
    time_ns_ = is_average_ ? time_ns_ + period_ns_ : stated_ns;
    return time_ns_;
  }
  bool isAverage() const { return is_average_; }

 private:
  static TimeNs nanoseconds(double ms) { return static_cast<TimeNs>(std::llround(ms * 1e6)); }

  TimeNs time_ns_;  ///< of the latest frame
  TimeNs period_ns_, offset_ns_ = 0;
  bool any_ = false, is_average_ = false;
};

class VideoSource : public FrameSource {
 public:
  VideoSource(const std::string& path, Colour colour, FrameSize size, TimeNs start_ns, double fallback_fps)
      : path_(path), colour_(colour), size_(size) {
    if (!fs::is_regular_file(path)) throw options::Error(path + ": no such video file");
    if (!capture_.open(path, backend(cv::CAP_FFMPEG)) || !capture_.read(captured_))
      throw options::Error(path + ": cannot be opened as a video");
    const double fps = capture_.get(cv::CAP_PROP_FPS), count = capture_.get(cv::CAP_PROP_FRAME_COUNT);
    fps_ = fps > 0.0 && fps < 1e5 ? fps : fallback_fps;
    times_ = VideoTimes(start_ns, fps_);
    count_ = count > 0.0 && count < 1e9 ? static_cast<std::size_t>(count) : 0;
  }

  bool next(cv::Mat& image, FrameInfo& info) override {
    if (sequence_ > 0 && !capture_.read(captured_)) return false;  // the constructor reads the first frame
    info.sequence = sequence_++;
    info.time_ns = times_.next(capture_.get(cv::CAP_PROP_POS_MSEC));
    info.fault.clear();
    info.state = copyFrame(captured_, colour_, size_, image, info.fault);
    if (!info.fault.empty()) info.where = fmt::format("{}: frame {}", path_, info.sequence);
    if (times_.isAverage() && !was_average_) notice_ = averageNotice(info.sequence);
    was_average_ = times_.isAverage();
    return true;
  }

  std::size_t size() const override { return count_; }
  std::string takeNotice() override { return std::exchange(notice_, {}); }

 private:
  std::string averageNotice(std::uint32_t frame) const {
    return fmt::format(
        "{}: frame {} has no time after that of the frame before it; from here on the frames are "
        "{:.1f} ms apart, the average of the file. Check the file, or convert it to a constant rate",
        path_, frame, 1e3 / fps_);
  }

  std::string path_;
  Colour colour_;
  FrameSize size_;
  double fps_ = 30.0;
  VideoTimes times_{0, 30.0};
  bool was_average_ = false;
  std::string notice_;
  std::size_t count_ = 0;
  std::uint32_t sequence_ = 0;
  cv::VideoCapture capture_;
  cv::Mat captured_;
};

}  // namespace

FrameState copyFrame(const cv::Mat& captured, Colour colour, FrameSize& size, cv::Mat& image,
                     std::string& fault) {
  if (captured.empty()) {
    fault = "the frame has no pixels";
    return FrameState::kEmpty;
  }
  if (size.width_px == 0) size = {captured.cols, captured.rows};
  const int type = colour == Colour::kGrey ? CV_8UC1 : CV_8UC3;
  if (image.empty()) image.create(size.height_px, size.width_px, type);
  const bool fits = captured.cols == size.width_px && captured.rows == size.height_px &&
                    image.size() == captured.size() && image.type() == type;
  if (!fits) {
    fault = fmt::format("the frame is {}×{}, expected {}×{}", captured.cols, captured.rows, size.width_px,
                        size.height_px);
    return FrameState::kWrongSize;
  }
  if (captured.type() == type) {
    captured.copyTo(image);
  } else if (captured.type() == CV_8UC3) {
    cv::cvtColor(captured, image, cv::COLOR_BGR2GRAY);
  } else if (captured.type() == CV_8UC1) {
    cv::cvtColor(captured, image, cv::COLOR_GRAY2BGR);
  } else {
    fault = "the frame is neither 8-bit grey nor BGR";
    return FrameState::kUnreadable;
  }
  return FrameState::kOk;
}

std::unique_ptr<FrameSource> openStream(const ImageStream& stream, Colour colour) {
  const FrameSize size{stream.camera.image_width_px, stream.camera.image_height_px};
  return std::make_unique<FileSource>(stream.rows, colour, size);
}

std::unique_ptr<FrameSource> openFolder(const std::string& folder, Colour colour, FrameSize size,
                                        TimeNs period_ns, TimeNs start_ns) {
  std::error_code error;
  const fs::directory_iterator entries(folder, error);
  if (error)
    throw options::Error(fmt::format("{}: this image folder cannot be opened: {}", folder, error.message()));
  if (period_ns <= 0) throw options::Error("the period of an image folder must be positive");
  std::vector<std::string> paths;
  for (const fs::directory_entry& entry : entries) {
    if (entry.is_regular_file() && isImageName(entry.path())) paths.push_back(entry.path().string());
  }
  if (paths.empty())
    throw options::Error(fmt::format("{}: contains no image ({})", folder, imageExtensionsText()));
  std::sort(paths.begin(), paths.end());
  std::vector<ImageRow> rows;
  for (std::size_t i = 0; i < paths.size(); ++i) {
    rows.push_back({start_ns + static_cast<TimeNs>(i) * period_ns, static_cast<std::uint32_t>(i), paths[i]});
  }
  return std::make_unique<FileSource>(std::move(rows), colour, size);
}

std::unique_ptr<FrameSource> openVideo(const std::string& path, Colour colour, FrameSize size,
                                       TimeNs start_ns, double fallback_fps) {
  return std::make_unique<VideoSource>(path, colour, size, start_ns, fallback_fps);
}

}  // namespace omnifleet::dataset
