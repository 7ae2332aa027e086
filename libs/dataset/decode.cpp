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

/// Offset of the first scan (SOS) of a JPEG; 0 when there is none.
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

/// libjpeg fills what a cut file lacks with grey and reports success, so the end-of-image marker is looked
/// for.
bool isTruncatedJpeg(const Bytes& b) {
  if (b.size() < 4 || b[0] != 0xFF || b[1] != 0xD8) return false;
  const std::size_t scan = firstScan(b);
  if (scan == 0) return true;
  for (std::size_t i = b.size() - 1; i > scan; --i) {
    if (b[i] == 0xD9 && b[i - 1] == 0xFF) return false;
  }
  return true;
}

/// Decodes with the caller's memory where size and type agree. An empty Mat when it cannot be decoded.
cv::Mat decode(const Bytes& buffer, Colour colour, const cv::Mat& target) {
  const int flags =
      (colour == Colour::kGrey ? cv::IMREAD_GRAYSCALE : cv::IMREAD_COLOR) | cv::IMREAD_IGNORE_ORIENTATION;
  cv::Mat header = target;  // shares the pixels; imdecode allocates anew only where size or type differ
  try {
    const cv::Mat result = cv::imdecode(buffer, flags, &header);
    return result.empty() ? cv::Mat() : header;
  } catch (const cv::Exception&) {
    return {};
  }
}

}  // namespace

FrameState decodeImage(const std::string& path, Colour colour, FrameSize size,
                       std::vector<unsigned char>& buffer, cv::Mat& image, std::string& note) {
  std::string reason;
  switch (readBytes(path, buffer, reason)) {
    case ReadResult::kMissing:
      note = path + ": is missing";
      return FrameState::kMissing;
    case ReadResult::kFailed:
      note = fmt::format("{}: {}", path, reason);
      return FrameState::kUnreadable;
    case ReadResult::kOk:
      break;
  }
  if (buffer.empty()) {
    note = path + ": is an empty file";
    return FrameState::kEmpty;
  }
  if (isTruncatedJpeg(buffer)) {
    note = path + ": the JPEG is cut short";
    return FrameState::kUnreadable;
  }
  const cv::Mat decoded = decode(buffer, colour, image);
  if (decoded.empty()) {
    note = path + ": is no image that can be decoded";
    return FrameState::kUnreadable;
  }
  const bool sized = size.width_px > 0;
  if (sized && (decoded.cols != size.width_px || decoded.rows != size.height_px)) {
    note = fmt::format("{}: is {}×{}, its calibration says {}×{}", path, decoded.cols, decoded.rows,
                       size.width_px, size.height_px);
    return FrameState::kWrongSize;
  }
  if (image.empty()) image = decoded;
  if (image.data != decoded.data) {
    note = fmt::format("{}: is {}×{}, the frame buffer {}×{}", path, decoded.cols, decoded.rows, image.cols,
                       image.rows);
    return FrameState::kWrongSize;
  }
  note.clear();
  return FrameState::kOk;
}

}  // namespace omnifleet::dataset
