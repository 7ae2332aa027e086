#include <fmt/format.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <opencv2/imgcodecs.hpp>

#include "dataset/frame_source.h"

namespace omnifleet::dataset {
namespace {

using Bytes = std::vector<unsigned char>;
enum class ReadResult { kOk, kMissing, kFailed };

ReadResult readBytes(const std::string& path, Bytes& buffer, std::string& reason) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"), &std::fclose);
  if (!file) {
    reason = std::strerror(errno);
    return errno == ENOENT ? ReadResult::kMissing : ReadResult::kFailed;
  }
  if (std::fseek(file.get(), 0, SEEK_END) != 0) return ReadResult::kFailed;
  const long size = std::ftell(file.get());
  if (size < 0 || size > (1L << 30)) {
    reason = "not an image file";
    return ReadResult::kFailed;
  }
  std::rewind(file.get());
  buffer.resize(static_cast<std::size_t>(size));
  if (std::fread(buffer.data(), 1, buffer.size(), file.get()) != buffer.size()) {
    reason = "cannot be read";
    return ReadResult::kFailed;
  }
  return ReadResult::kOk;
}

/// Offset of the first scan (SOS marker) of a JPEG; 0 if there is none.
std::size_t firstScan(const Bytes& b) {
  std::size_t i = 2;
  while (i + 4 <= b.size()) {
    if (b[i] != 0xFF) return 0;
    if (b[i + 1] == 0xDA) return i;
    if (b[i + 1] == 0xFF) {
      ++i;  // fill byte
      continue;
    }
    i += 2 + (static_cast<std::size_t>(b[i + 2]) << 8) + b[i + 3];
  }
  return 0;
}

/// libjpeg fills the missing part of a truncated file with grey and reports success. So this looks for the
/// end-of-image marker.
bool isTruncatedJpeg(const Bytes& b) {
  if (b.size() < 4 || b[0] != 0xFF || b[1] != 0xD8) return false;
  const std::size_t scan = firstScan(b);
  if (scan == 0) return true;
  for (std::size_t i = b.size() - 1; i > scan; --i) {
    if (b[i] == 0xD9 && b[i - 1] == 0xFF) return false;
  }
  return true;
}

/// Returns the caller's pixels for an allocation of exactly their size and type, other memory otherwise. The
/// decoder starts from an empty Mat, which stays empty when it fails. A Mat passed to cv::imdecode directly
/// would keep the pixels of the previous frame and look like success.
class TargetAllocator : public cv::MatAllocator {
 public:
  explicit TargetAllocator(const cv::Mat& target) : target_(target) {}

  cv::UMatData* allocate(int dims, const int* sizes, int type, void* data, std::size_t* step,
                         cv::AccessFlag flags, cv::UMatUsageFlags usage) const override {
    const bool fits = !data && dims == 2 && !target_.empty() && target_.isContinuous() &&
                      sizes[0] == target_.rows && sizes[1] == target_.cols && type == target_.type();
    if (!fits) return cv::Mat::getStdAllocator()->allocate(dims, sizes, type, data, step, flags, usage);
    step[1] = target_.elemSize();
    step[0] = step[1] * static_cast<std::size_t>(sizes[1]);
    auto* u = new cv::UMatData(this);
    u->data = u->origdata = target_.data;
    u->size = step[0] * static_cast<std::size_t>(sizes[0]);
    u->flags |= cv::UMatData::USER_ALLOCATED;
    return u;
  }
  bool allocate(cv::UMatData* u, cv::AccessFlag, cv::UMatUsageFlags) const override { return u != nullptr; }
  void deallocate(cv::UMatData* u) const override { delete u; }  // the caller owns the pixels

 private:
  const cv::Mat& target_;
};

/// Decodes into the caller's memory if size and type agree. False if the buffer cannot be decoded.
bool decode(const Bytes& buffer, Colour colour, const TargetAllocator& allocator, cv::Mat& decoded) {
  const int flags =
      (colour == Colour::kGrey ? cv::IMREAD_GRAYSCALE : cv::IMREAD_COLOR) | cv::IMREAD_IGNORE_ORIENTATION;
  decoded.allocator = const_cast<TargetAllocator*>(
      &allocator);  // OpenCV takes a mutable pointer, but calls only const members
  try {
    cv::imdecode(buffer, flags, &decoded);
  } catch (const cv::Exception&) {
    return false;
  }
  return !decoded.empty();
}

}  // namespace

FrameState decodeImage(const std::string& path, Colour colour, FrameSize size,
                       std::vector<unsigned char>& buffer, cv::Mat& image, std::string& fault) {
  std::string reason;
  switch (readBytes(path, buffer, reason)) {
    case ReadResult::kMissing:
      fault = "does not exist";
      return FrameState::kMissing;
    case ReadResult::kFailed:
      fault = reason;
      return FrameState::kUnreadable;
    case ReadResult::kOk:
      break;
  }
  if (buffer.empty()) {
    fault = "the file is empty";
    return FrameState::kEmpty;
  }
  if (isTruncatedJpeg(buffer)) {
    fault = "the JPEG is truncated";
    return FrameState::kUnreadable;
  }
  const TargetAllocator allocator(image);
  cv::Mat decoded;
  if (!decode(buffer, colour, allocator, decoded)) {
    fault = "cannot be decoded as an image";
    return FrameState::kUnreadable;
  }
  const bool sized = size.width_px > 0;
  if (sized && (decoded.cols != size.width_px || decoded.rows != size.height_px)) {
    fault = fmt::format("is {}×{}, but its calibration is for {}×{}", decoded.cols, decoded.rows,
                        size.width_px, size.height_px);
    return FrameState::kWrongSize;
  }
  if (image.empty()) {
    decoded.allocator = nullptr;
    image = decoded;
  }
  if (image.data != decoded.data) {
    fault = fmt::format("is {}×{}, but the frame buffer is for {}×{}", decoded.cols, decoded.rows, image.cols,
                        image.rows);
    return FrameState::kWrongSize;
  }
  fault.clear();
  return FrameState::kOk;
}

}  // namespace omnifleet::dataset
