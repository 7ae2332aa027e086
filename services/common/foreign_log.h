#pragma once

namespace omnifleet::services {

/// Switches off the lines that OpenCV and FFmpeg write beside the logs, for this process and its children.
/// The readers of images report each unreadable one themselves, with its file. A user who sets
/// OPENCV_LOG_LEVEL or OPENCV_FFMPEG_LOGLEVEL gets the lines. Call before other threads start.
void silenceImageLibraries();

}  // namespace omnifleet::services
