// Frames on the fake network: shared slots instead of shared memory, with the same loan rules.

#include <stdexcept>

#include "bus/fake_network.h"
#include "bus/partition.h"
#include "bus/topics.h"

namespace omnifleet::bus {
namespace {

struct FrameSlot {
  FrameHeader header;
  std::vector<std::uint8_t> pixels;
};
using SlotPtr = std::shared_ptr<FrameSlot>;

class FakeFrameReader : public FrameReader, public FakeEndpoint {
 public:
  FakeFrameReader(std::shared_ptr<FakeNetwork> network, QosProfile qos, Report report)
      : network_(std::move(network)), qos_(qos), report_(std::move(report)) {}
  ~FakeFrameReader() override { network_->detach(*this); }

  /// The caller holds the mutex.
  bool full() const { return qos_.keep_all && static_cast<int>(queue_.size()) >= qos_.depth; }
  void deliver(const SlotPtr& slot, const FakeEndpoint& writer) {
    if (writer.idl_hash != idl_hash) {
      if (counters_.rejected++ == 0 && report_)
        report_(topic +
                ": frames of a writer with another IDL are dropped; build all services from the same idl/");
      return;
    }
    queue_.push_back(slot);
    if (!qos_.keep_all && static_cast<int>(queue_.size()) > qos_.depth) {
      queue_.pop_front();
      ++counters_.lost;
    }
    signal->event.signal();
  }

  std::optional<FrameView> take() override {
    std::lock_guard<std::mutex> lock(network_->mutex);
    if (held_ || queue_.empty()) return std::nullopt;
    held_ = std::move(queue_.front());
    queue_.pop_front();
    ++counters_.received;
    network_->forEachPeer(*this,
                          [](FakeEndpoint& writer) { writer.signal->event.signal(); });  // a slot is free
    return FrameView{held_->header, held_->pixels.data()};
  }
  bool stillValid() override { return held_ != nullptr; }
  void release() override {
    std::lock_guard<std::mutex> lock(network_->mutex);
    held_.reset();
  }
  bool holding() const override { return held_ != nullptr; }
  int matched() const override { return network_->matched(*this); }
  bool waitForWriters(int count, std::chrono::nanoseconds timeout) override {
    return signal->waitUntil([&] { return matched() >= count; }, timeout);
  }
  FrameCounters counters() const override {
    std::lock_guard<std::mutex> lock(network_->mutex);
    return counters_;
  }

 private:
  std::shared_ptr<FakeNetwork> network_;
  QosProfile qos_;
  Report report_;
  std::deque<SlotPtr> queue_;
  SlotPtr held_;
  FrameCounters counters_;
};

class FakeFrameWriter : public FrameWriter, public FakeEndpoint {
 public:
  FakeFrameWriter(std::shared_ptr<FakeNetwork> network, FrameClass frame_class)
      : network_(std::move(network)), class_(frame_class) {}
  ~FakeFrameWriter() override { network_->detach(*this); }

  std::uint8_t* begin(const FrameHeader& header) override {
    abandon();
    error_.clear();
    if (!fits(header)) return nullptr;
    std::lock_guard<std::mutex> lock(network_->mutex);
    if (anyReaderFull()) return nullptr;
    open_ = freeSlot();
    open_->header = header;
    open_->pixels.resize(header.bytes());
    return open_->pixels.empty() ? &nothing_ : open_->pixels.data();
  }
  void amend(const FrameHeader& header) override {
    if (!open_ || header.bytes() > open_->pixels.size())
      throw std::runtime_error(topic + ": the amended frame is larger than its loan");
    open_->header = header;
  }
  bool publish() override {
    if (!open_) {
      error_ = topic + ": publish() without begin()";
      return false;
    }
    std::lock_guard<std::mutex> lock(network_->mutex);
    network_->forEachPeer(
        *this, [&](FakeEndpoint& peer) { dynamic_cast<FakeFrameReader&>(peer).deliver(open_, *this); });
    open_.reset();
    return true;
  }
  void abandon() override { open_.reset(); }
  int matched() const override { return network_->matched(*this); }
  bool waitForReaders(int count, std::chrono::nanoseconds timeout) override {
    return signal->waitUntil([&] { return matched() >= count; }, timeout);
  }
  const std::string& error() const override { return error_; }

 private:
  bool fits(const FrameHeader& header) {
    if (header.bytes() <= class_.capacity) return true;
    error_ = topic + ": a frame of " + std::to_string(header.bytes()) + " bytes is larger than frame class " +
             class_.name;
    return false;
  }
  bool anyReaderFull() {
    bool full = false;
    network_->forEachPeer(*this,
                          [&](FakeEndpoint& peer) { full |= dynamic_cast<FakeFrameReader&>(peer).full(); });
    return full;
  }
  /// A slot that no reader uses, or else a new one. The queues of the readers bound the number of slots.
  SlotPtr freeSlot() {
    for (const SlotPtr& slot : pool_) {
      if (slot.use_count() == 1) return slot;
    }
    pool_.push_back(std::make_shared<FrameSlot>());
    return pool_.back();
  }

  std::shared_ptr<FakeNetwork> network_;
  FrameClass class_;
  std::vector<SlotPtr> pool_;
  SlotPtr open_;
  std::uint8_t nothing_ = 0;  ///< begin() points here for an invalid frame without pixels
  std::string error_;
};

void attach(FakeNetwork& network, FakeEndpoint& end, FakeEndpoint::Kind kind, const FakeBusOptions& options,
            std::shared_ptr<BusSignal> signal, const std::string& camera_id, const FrameClass& frame_class) {
  end.kind = kind;
  end.topic = cameraTopicName(camera_id);
  end.type_name = frame_class.name;
  end.idl_hash = options.idl_hash;
  end.partitions = framePartitions(options.machine);
  end.signal = std::move(signal);
  network.attach(end);
}

}  // namespace

std::unique_ptr<FrameWriter> makeFakeFrameWriter(std::shared_ptr<FakeNetwork> network,
                                                 const FakeBusOptions& options,
                                                 std::shared_ptr<BusSignal> signal,
                                                 const std::string& camera_id, std::size_t bytes_needed) {
  const FrameClass frame_class = frameClassFor(bytes_needed);
  auto writer = std::make_unique<FakeFrameWriter>(network, frame_class);
  attach(*network, *writer, FakeEndpoint::Kind::kWriter, options, std::move(signal), camera_id, frame_class);
  return writer;
}

std::unique_ptr<FrameReader> makeFakeFrameReader(std::shared_ptr<FakeNetwork> network,
                                                 const FakeBusOptions& options,
                                                 std::shared_ptr<BusSignal> signal,
                                                 const std::string& camera_id, std::size_t bytes_needed) {
  const FrameClass frame_class = frameClassFor(bytes_needed);
  auto reader = std::make_unique<FakeFrameReader>(network, frameQos(options.mode), options.report);
  attach(*network, *reader, FakeEndpoint::Kind::kReader, options, std::move(signal), camera_id, frame_class);
  return reader;
}

}  // namespace omnifleet::bus
