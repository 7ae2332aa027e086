// OpenCV links GStreamer, but hides its reasons. The few functions needed are looked up at run time:
// omnifleet itself does not depend on GStreamer.
#include "dataset/gstreamer_reason.h"

#include <dlfcn.h>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <mutex>

namespace omnifleet::dataset {
namespace {

// Public structures of GLib 2 (gerror.h, gmessages.h).
struct GLibError {
  std::uint32_t domain;
  int code;
  char* message;
};
struct GLibField {
  const char* key;
  const void* value;
  std::ptrdiff_t length;  // -1: terminated by zero
};
using GLibWriter = int (*)(int level, const GLibField* fields, std::size_t count, void* data);

template <typename Function>
Function lookUp(const char* name) {
  return reinterpret_cast<Function>(::dlsym(RTLD_DEFAULT, name));
}

struct Latest {
  std::mutex mutex;
  std::string text;
};
Latest& latest() {
  static Latest instance;
  return instance;
}

int keepMessage(int level, const GLibField* fields, std::size_t count, void*) {
  constexpr int kSevere = 1 << 2 | 1 << 3 | 1 << 4;  // error, critical, warning
  constexpr int kHandled = 1;
  if ((level & kSevere) == 0) return kHandled;
  std::string source, text;
  for (std::size_t i = 0; i < count; ++i) {
    const std::string key = fields[i].key;
    if (key != "MESSAGE" && key != "GLIB_DOMAIN") continue;
    const auto* value = static_cast<const char*>(fields[i].value);
    (key == "MESSAGE" ? text : source) = fields[i].length < 0
                                             ? std::string(value)
                                             : std::string(value, static_cast<std::size_t>(fields[i].length));
  }
  const std::lock_guard lock(latest().mutex);
  latest().text = source.empty() ? text : source + ": " + text;
  return kHandled;
}

}  // namespace

void receiveGLibMessages() {
  static std::once_flag once;
  std::call_once(once, [] {
    const auto set = lookUp<void (*)(GLibWriter, void*, void*)>("g_log_set_writer_func");
    if (set != nullptr && std::getenv("G_MESSAGES_DEBUG") == nullptr) set(&keepMessage, nullptr, nullptr);
  });
}

std::string pipelineReason(const std::string& pipeline) {
  const auto parse = lookUp<void* (*)(const char*, GLibError**)>("gst_parse_launch");
  const auto is_ready = lookUp<int (*)()>("gst_is_initialized");
  if (parse == nullptr || is_ready == nullptr || is_ready() == 0) return "this OpenCV has no GStreamer";
  GLibError* error = nullptr;
  void* bin = parse(pipeline.c_str(), &error);
  std::string reason;
  if (error != nullptr) {
    reason = error->message;
    if (const auto release = lookUp<void (*)(GLibError*)>("g_error_free")) release(error);
  }
  if (const auto release = lookUp<void (*)(void*)>("gst_object_unref"); release != nullptr && bin != nullptr)
    release(bin);
  if (!reason.empty()) return reason;
  const std::lock_guard lock(latest().mutex);
  if (!latest().text.empty()) return latest().text;
  return "it does not start; it must end in appsink, and its device must exist and be free";
}

}  // namespace omnifleet::dataset
