#include "common/office.h"

#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <thread>

namespace omnifleet::services {
namespace {

std::size_t rankOf(const std::vector<std::string>& candidates, const std::string& name) {
  return static_cast<std::size_t>(std::find(candidates.begin(), candidates.end(), name) - candidates.begin());
}

}  // namespace

/// The thread that publishes. DDS liveliness cannot replace it: in Fast DDS 2.9 a reader that hears several
/// leased writers notices the death of one only when its participant is gone (docs/methods/dds.md).
class Office::Heartbeat {
 public:
  Heartbeat(std::unique_ptr<bus::Writer<v1::Candidacy>> writer, const std::string& office,
            const std::string& self)
      : writer_(std::move(writer)), updated_(std::chrono::steady_clock::now()) {
    sample_.office(office);
    sample_.candidate(self);
    thread_ = std::thread([this] { run(); });
  }
  ~Heartbeat() { stop(); }

  void stop() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stopped_ = true;
    }
    changed_.notify_all();
    if (thread_.joinable()) thread_.join();
  }
  void noteUpdate() {
    const std::lock_guard<std::mutex> lock(mutex_);
    updated_ = std::chrono::steady_clock::now();
  }
  void publish(std::uint32_t term, std::uint32_t yielded, bool finished) {
    const std::lock_guard<std::mutex> lock(mutex_);
    sample_.term(term);
    sample_.yielded(yielded);
    sample_.finished(finished);
    write();
  }

 private:
  /// A lost heartbeat is replaced by the next one.
  void write() { [[maybe_unused]] const bool written = writer_->write(sample_); }
  void run() {
    std::unique_lock<std::mutex> lock(mutex_);
    while (!stopped_) {
      if (std::chrono::steady_clock::now() - updated_ < kHang) write();
      changed_.wait_for(lock, kPeriod);
    }
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  std::unique_ptr<bus::Writer<v1::Candidacy>> writer_;
  v1::Candidacy sample_;
  std::chrono::steady_clock::time_point updated_;
  bool stopped_ = false;
  std::thread thread_;
};

Office::Office(const bus::ServiceContext& context, const std::string& office,
               const std::vector<std::string>& candidates, const std::string& self, Time now)
    : office_(office),
      candidates_(candidates),
      rank_(rankOf(candidates, self)),
      election_(rank_, candidates.size(), now),
      others_(candidates.size()),
      reader_(context.bus.reader(context.topics.election)),
      heartbeat_(std::make_unique<Heartbeat>(context.bus.writer(context.topics.election), office, self)) {}

Office::~Office() = default;

bool Office::update(Time now) {
  heartbeat_->noteUpdate();
  while (reader_->take(sample_)) {
    const std::size_t rank = rankOf(candidates_, sample_.candidate().to_string());
    if (sample_.office() != office_ || rank == rank_ || rank == candidates_.size()) continue;
    others_[rank] = {now, sample_.term(), sample_.yielded()};
    if (sample_.finished()) election_.finish();
  }
  for (std::size_t i = 0; i < others_.size(); ++i) {
    Other& other = others_[i];
    if (other.heard && now - *other.heard >= kLease) other.heard.reset();
    if (i != rank_) election_.hear(i, other.heard.has_value(), other.term, other.yielded);
  }
  if (!election_.update(now)) return false;
  heartbeat_->publish(term(), election_.yielded(), false);
  return true;
}

std::optional<Office::Time> Office::wakeAt() const {
  std::optional<Time> first = election_.wakeAt();
  for (const Other& other : others_) {
    if (!other.heard || other.term == 0) continue;
    const Time silent = *other.heard + kLease;
    if (!first || silent < *first) first = silent;
  }
  return first;
}

void Office::leave(bool finished) {
  heartbeat_->publish(0, 0, finished && term() > 0);
  heartbeat_->stop();
}

}  // namespace omnifleet::services
