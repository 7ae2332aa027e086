#include "bus/fake_bus.h"

#include <algorithm>
#include <atomic>
#include <set>
#include <stdexcept>

#include "bus/fake_network.h"
#include "bus/partition.h"

namespace omnifleet::bus {
namespace {

/// Counted by all endpoints of one bus.
struct FakeTraffic {
  std::atomic<std::uint64_t> out_bytes{0}, in_bytes{0};
};

struct FakeSample {
  std::shared_ptr<const void> value;
  std::string key;
  std::uint64_t writer = 0;
};

/// Keep-last: drops the oldest sample of the instance beyond `depth`. @return whether a sample was dropped
bool keepLast(std::deque<FakeSample>& samples, const std::string& key, int depth) {
  const auto same = [&](const FakeSample& sample) { return sample.key == key; };
  if (std::count_if(samples.begin(), samples.end(), same) <= depth) return false;
  samples.erase(std::find_if(samples.begin(), samples.end(), same));
  return true;
}

class FakeReaderPort : public ReaderPort, public FakeEndpoint {
 public:
  FakeReaderPort(std::shared_ptr<FakeNetwork> network, const TypeDescriptor& type, QosProfile qos,
                 Report report, std::shared_ptr<FakeTraffic> traffic)
      : network_(std::move(network)),
        type_(type),
        qos_(qos),
        report_(std::move(report)),
        traffic_(std::move(traffic)) {}
  ~FakeReaderPort() override { network_->detach(*this); }

  /// The caller holds the mutex.
  void deliver(const FakeSample& sample, const FakeEndpoint& writer) {
    if (writer.idl_hash != idl_hash) return reject(writer);
    samples_.push_back(sample);
    if (!qos_.keep_all && keepLast(samples_, sample.key, qos_.depth)) ++counters_.lost;
    signal->event.signal();
  }

  bool take(void* sample, SampleInfo& info) override {
    FakeSample head;
    {
      std::lock_guard<std::mutex> lock(network_->mutex);
      if (samples_.empty()) return false;
      head = std::move(samples_.front());
      samples_.pop_front();
      ++counters_.received;
    }
    type_.copy(sample, head.value.get());
    if (qos_.off_host) traffic_->in_bytes += type_.size(sample);
    info.writer = head.writer;
    info.source_ns = 0;
    return true;
  }
  int matched() const override { return network_->matched(*this); }
  bool waitForWriters(int count, std::chrono::nanoseconds timeout) override {
    return signal->waitUntil([&] { return matched() >= count; }, timeout);
  }
  ReaderCounters counters() const override {
    std::lock_guard<std::mutex> lock(network_->mutex);
    return counters_;
  }

 private:
  void reject(const FakeEndpoint& writer) {
    ++counters_.rejected;
    if (!external_.insert(writer.id).second || !report_) return;
    report_(topic +
            ": samples of a writer with another IDL are dropped; build all services from the same idl/");
  }

  std::shared_ptr<FakeNetwork> network_;
  const TypeDescriptor& type_;
  QosProfile qos_;
  Report report_;
  std::shared_ptr<FakeTraffic> traffic_;
  std::deque<FakeSample> samples_;
  ReaderCounters counters_;
  std::set<std::uint64_t> external_;
};

class FakeWriterPort : public WriterPort, public FakeEndpoint {
 public:
  FakeWriterPort(std::shared_ptr<FakeNetwork> network, const TypeDescriptor& type, QosProfile qos,
                 std::shared_ptr<FakeTraffic> traffic)
      : network_(std::move(network)), type_(type), qos_(qos), traffic_(std::move(traffic)) {}
  ~FakeWriterPort() override { network_->detach(*this); }

  bool write(const void* value) override {
    const std::string key = type_.key(value);
    if (!admit(key)) return false;
    const std::shared_ptr<void> copy = type_.create();
    type_.copy(copy.get(), value);
    const FakeSample sample{copy, key, id};
    std::lock_guard<std::mutex> lock(network_->mutex);
    if (qos_.transient_local) {
      history_.push_back(sample);
      keepLast(history_, key, qos_.keep_all ? qos_.max_samples_per_instance : qos_.depth);
    }
    bool any = false;
    network_->forEachPeer(*this, [&](FakeEndpoint& peer) {
      dynamic_cast<FakeReaderPort&>(peer).deliver(sample, *this);
      any = true;
    });
    if (any && qos_.off_host) traffic_->out_bytes += type_.size(value);
    return true;
  }
  int matched() const override { return network_->matched(*this); }
  bool waitForReaders(int count, std::chrono::nanoseconds timeout) override {
    return signal->waitUntil([&] { return matched() >= count; }, timeout);
  }
  const std::string& error() const override { return error_; }

  /// Delivers the history to a late joiner.
  void onPeer(FakeEndpoint& peer) override {
    for (const FakeSample& sample : history_) dynamic_cast<FakeReaderPort&>(peer).deliver(sample, *this);
  }

 private:
  bool admit(const std::string& key) {
    error_.clear();
    if (keys_.count(key) == 0 && static_cast<int>(keys_.size()) >= qos_.max_instances) {
      error_ = topic + ": more than " + std::to_string(qos_.max_instances) + " keys (max_instances)";
      return false;
    }
    keys_.insert(key);
    return true;
  }

  std::shared_ptr<FakeNetwork> network_;
  const TypeDescriptor& type_;
  QosProfile qos_;
  std::shared_ptr<FakeTraffic> traffic_;
  std::deque<FakeSample> history_;
  std::set<std::string> keys_;
  std::string error_;
};

class FakeBus : public Bus {
 public:
  FakeBus(std::shared_ptr<FakeNetwork> network, FakeBusOptions options)
      : network_(std::move(network)), options_(std::move(options)), signal_(std::make_shared<BusSignal>()) {}

  std::unique_ptr<FrameWriter> frameWriter(const std::string& camera_id, std::size_t bytes_needed) override {
    return makeFakeFrameWriter(network_, options_, signal_, camera_id, bytes_needed);
  }
  std::unique_ptr<FrameReader> frameReader(const std::string& camera_id, std::size_t bytes_needed) override {
    return makeFakeFrameReader(network_, options_, signal_, camera_id, bytes_needed);
  }
  bool wait(std::chrono::nanoseconds timeout) override { return signal_->event.wait(timeout); }
  void wake() noexcept override { signal_->event.signal(); }
  void requestStop() noexcept override {
    signal_->stop = true;
    signal_->event.signal();
  }
  bool stopping() const noexcept override { return signal_->stop; }
  bool flush(std::chrono::nanoseconds) override { return true; }  // write() has already delivered
  Traffic traffic() const override { return {traffic_->out_bytes, traffic_->in_bytes}; }

 protected:
  std::unique_ptr<WriterPort> writerPort(const std::string& topic, const QosProfile& qos,
                                         const TypeDescriptor& type, const std::string& robot) override {
    auto port = std::make_unique<FakeWriterPort>(network_, type, qos, traffic_);
    attach(*port, FakeEndpoint::Kind::kWriter, topic, type, writerPartitions(robot));
    return port;
  }
  std::unique_ptr<ReaderPort> readerPort(const std::string& topic, const QosProfile& qos,
                                         const TypeDescriptor& type, const std::string& robot) override {
    auto port = std::make_unique<FakeReaderPort>(network_, type, qos, options_.report, traffic_);
    attach(*port, FakeEndpoint::Kind::kReader, topic, type, readerPartitions(robot));
    return port;
  }

 private:
  void attach(FakeEndpoint& end, FakeEndpoint::Kind kind, const std::string& topic,
              const TypeDescriptor& type, std::vector<std::string> partitions) {
    end.kind = kind;
    end.topic = topic;
    end.type_name = type.name;
    end.idl_hash = options_.idl_hash.empty() ? type.idl_hash : options_.idl_hash;
    end.partitions = std::move(partitions);
    end.signal = signal_;
    network_->attach(end);
  }

  std::shared_ptr<FakeNetwork> network_;
  FakeBusOptions options_;
  std::shared_ptr<BusSignal> signal_;
  std::shared_ptr<FakeTraffic> traffic_ = std::make_shared<FakeTraffic>();
};

}  // namespace

std::unique_ptr<Bus> makeFakeBus(std::shared_ptr<FakeNetwork> network, const FakeBusOptions& options) {
  return std::make_unique<FakeBus>(std::move(network), options);
}

}  // namespace omnifleet::bus
