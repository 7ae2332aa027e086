#include "dataset/live_camera.h"

#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <utility>

namespace omnifleet::dataset {
namespace {

using Clock = LiveCamera::Clock;

constexpr int kFailedReads = 3;                         // in a row, after which the device is opened again
constexpr int kMostThreads = 4;                         // that may hang in the driver at the same time
constexpr auto kLook = std::chrono::milliseconds(100);  // period of the looks for a device that is absent

Clock::duration seconds(double s) {
  return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(s));
}

}  // namespace

LiveCameraOptions LiveCameraOptions::read(const options::Section& section) {
  LiveCameraOptions o;
  section.read("retry_first_s", o.retry_first_s, {0.01, 60.0});
  section.read("retry_longest_s", o.retry_longest_s, {0.01, 60.0});
  section.read("read_timeout_s", o.read_timeout_s, {0.1, 600.0});
  if (o.retry_longest_s < o.retry_first_s) section.fail("retry_longest_s", "must not be below retry_first_s");
  section.finish();
  return o;
}

/// Shared by the owner and the capturing threads. Only the thread of the newest generation may change it.
struct LiveCamera::State {
  // constant
  std::unique_ptr<CaptureDevice> device;
  LiveCameraOptions options;
  std::function<TimeNs()> clock;
  std::function<void()> wake;

  std::mutex mutex;
  std::condition_variable changed;
  int generation = 0;  ///< number of the thread that may write
  int threads = 0;     ///< that have not ended
  bool stopping = false;
  bool reopening = false;
  std::optional<Clock::time_point> busy_since;  ///< a call of the driver has not returned since then
  Clock::time_point last_frame = Clock::now();  ///< or the construction
  std::string fault;                            ///< why there are no frames; empty: they arrive
  LiveFrame newest;
  bool has_newest = false;
  std::uint32_t sequence = 0;

  bool owns(int thread) const { return !stopping && thread == generation; }
  void run(int thread);
  bool begin(int thread);
  bool finish(int thread, TimeNs* time_ns = nullptr);
  void lose(int thread, const std::string& reason);
  bool deliver(int thread, cv::Mat& image, TimeNs time_ns);
  void capture(int thread, Capture& connection, Clock::duration& pause);
  void wait(int thread, Clock::duration pause, bool present);
};

/// Before a call of the driver.
bool LiveCamera::State::begin(int thread) {
  const std::lock_guard lock(mutex);
  if (!owns(thread)) return false;
  busy_since = Clock::now();
  return true;
}

/// After a call of the driver. False: the owner has given this thread up meanwhile; its clock may be gone as
/// well.
bool LiveCamera::State::finish(int thread, TimeNs* time_ns) {
  const std::lock_guard lock(mutex);
  if (!owns(thread)) return false;
  if (time_ns != nullptr) *time_ns = clock();
  busy_since.reset();
  return true;
}

void LiveCamera::State::lose(int thread, const std::string& reason) {
  const std::lock_guard lock(mutex);
  if (!owns(thread)) return;
  fault = reason;
  wake();
}

bool LiveCamera::State::deliver(int thread, cv::Mat& image, TimeNs time_ns) {
  const std::lock_guard lock(mutex);
  if (!owns(thread) || reopening) return false;
  cv::swap(newest.image, image);
  newest.time_ns = time_ns;
  newest.sequence = sequence++;
  has_newest = true;
  last_frame = Clock::now();
  fault.clear();
  wake();
  return true;
}

/// Reads frames until the connection fails.
void LiveCamera::State::capture(int thread, Capture& connection, Clock::duration& pause) {
  cv::Mat image;
  for (int failed = 0; failed < kFailedReads;) {
    if (!begin(thread)) return;
    const bool arrived = connection.read(image) && !image.empty();
    TimeNs time_ns = 0;
    if (!finish(thread, &time_ns)) return;
    failed = arrived ? 0 : failed + 1;
    if (!arrived) continue;
    if (!deliver(thread, image, time_ns)) return;
    pause = seconds(options.retry_first_s);
  }
  lose(thread, "the device returns no frame");
}

/// Ends early when the device appears: then a frame comes within a moment of its return.
/// @param present whether it was there before the attempt to open it: it may return while that fails
void LiveCamera::State::wait(int thread, Clock::duration pause, bool present) {
  const auto until = Clock::now() + pause;
  while (Clock::now() < until) {
    const bool was_present = std::exchange(present, device->isPresent());
    if (present && !was_present) return;
    std::unique_lock lock(mutex);
    changed.wait_for(lock, std::min<Clock::duration>(kLook, until - Clock::now()),
                     [&] { return !owns(thread); });
    if (!owns(thread)) return;
  }
}

void LiveCamera::State::run(int thread) {
  auto pause = seconds(options.retry_first_s);
  while (begin(thread)) {
    std::string reason;
    bool present = device->isPresent();
    std::unique_ptr<Capture> connection = device->open(reason);
    if (!finish(thread)) break;
    if (connection) {
      capture(thread, *connection, pause);
      if (!begin(thread)) break;
      connection.reset();  // closing may hang as well
      if (!finish(thread)) break;
      present = device->isPresent();
    } else {
      lose(thread, reason);
    }
    bool asked = false;
    {
      const std::lock_guard lock(mutex);
      asked = std::exchange(reopening, false);
    }
    wait(thread, asked ? seconds(options.retry_longest_s) : pause, present);
    pause = std::min(2 * pause, seconds(options.retry_longest_s));
  }
}

LiveCamera::LiveCamera(std::unique_ptr<CaptureDevice> device, LiveCameraOptions options,
                       std::function<TimeNs()> clock, std::function<void()> wake)
    : state_(std::make_shared<State>()) {
  state_->device = std::move(device);
  state_->options = options;
  state_->clock = std::move(clock);
  state_->wake = std::move(wake);
  startThread();
}

void LiveCamera::startThread() {
  int thread = 0;
  {
    const std::lock_guard lock(state_->mutex);
    thread = ++state_->generation;
    ++state_->threads;
    state_->busy_since.reset();
  }
  // Detached: a thread that hangs in the driver cannot be joined. It holds the state.
  std::thread([state = state_, thread] {
    state->run(thread);
    const std::lock_guard lock(state->mutex);
    --state->threads;
    state->changed.notify_all();
  }).detach();
}

LiveCamera::~LiveCamera() {
  std::unique_lock lock(state_->mutex);
  state_->stopping = true;
  state_->changed.notify_all();
  state_->changed.wait_for(lock, kStopLimit, [this] { return state_->threads == 0; });
}

bool LiveCamera::take(LiveFrame& frame) {
  const std::lock_guard lock(state_->mutex);
  if (!state_->has_newest) return false;
  std::swap(frame, state_->newest);
  state_->has_newest = false;
  return true;
}

std::optional<LiveCamera::Loss> LiveCamera::loss(Clock::time_point now) {
  bool hangs = false;
  std::optional<Loss> loss;
  {
    const std::lock_guard lock(state_->mutex);
    hangs = state_->busy_since && now - *state_->busy_since > seconds(state_->options.read_timeout_s);
    if (hangs) state_->fault = "the device does not answer";
    hangs = hangs && state_->threads < kMostThreads;
    if (!state_->fault.empty()) loss = Loss{state_->last_frame, state_->fault};
  }
  if (hangs) startThread();
  return loss;
}

void LiveCamera::reopen() {
  const std::lock_guard lock(state_->mutex);
  state_->reopening = true;
}

}  // namespace omnifleet::dataset
