#pragma once

#include <string>

namespace omnifleet::dataset {

/// Receives the warnings and critical messages of GLib and GStreamer, which would be written to stderr beside
/// the log, for pipelineReason(). The user gets them on stderr by setting G_MESSAGES_DEBUG. Does nothing if
/// OpenCV was built without GStreamer. Any number of calls from any thread.
void receiveGLibMessages();

/// Why GStreamer does not run a pipeline that OpenCV could not open: what its parser refuses, or else the
/// latest message of GLib. Call after receiveGLibMessages() and the attempt. Never empty.
std::string pipelineReason(const std::string& pipeline);

}  // namespace omnifleet::dataset
