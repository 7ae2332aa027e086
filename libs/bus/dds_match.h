#pragma once

// What an endpoint records about its peers: number of matches, writer of each sample, IDL of each writer.

#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>

#include <algorithm>
#include <atomic>
#include <deque>

#include "bus/dds_participant.h"

namespace omnifleet::bus {

/// Counts matches and wakes the bus. Called from threads of DDS.
struct WriterMatches : dds::DataWriterListener {
  explicit WriterMatches(BusSignal& bus_signal) : signal(bus_signal) {}
  void on_publication_matched(dds::DataWriter*, const dds::PublicationMatchedStatus& status) override {
    matched = status.current_count;
    signal.event.signal();
  }
  BusSignal& signal;
  std::atomic<int> matched{0};
};

struct ReaderMatches : dds::DataReaderListener {
  explicit ReaderMatches(BusSignal& bus_signal) : signal(bus_signal) {}
  void on_data_available(dds::DataReader*) override { signal.event.signal(); }
  void on_subscription_matched(dds::DataReader*, const dds::SubscriptionMatchedStatus& status) override {
    matched = status.current_count;
    signal.event.signal();
  }
  BusSignal& signal;
  std::atomic<int> matched{0};
};

struct KnownWriter {
  Guid guid;
  std::uint64_t number = 0;                      ///< from 1, in order of the first sample
  bool is_external = false;                      ///< built from another IDL
  std::uint64_t first = 0, last = 0, count = 0;  ///< received sequence numbers
};

/// The writers from which one reader has received samples. Used only by the thread of the reader.
class KnownWriters {
 public:
  KnownWriters(DdsParticipant& participant, std::string topic, std::string idl_hash)
      : participant_(participant), topic_(std::move(topic)), idl_hash_(std::move(idl_hash)) {}

  /// Counts one sample. @return its writer
  const KnownWriter& arrived(const dds::SampleInfo& info) {
    const std::uint64_t sequence = info.sample_identity.sequence_number().to64long();
    KnownWriter& writer = find(info.sample_identity.writer_guid(), sequence);
    writer.first = std::min(writer.first, sequence);
    writer.last = std::max(writer.last, sequence);
    ++writer.count;
    if (writer.is_external) ++rejected_;
    return writer;
  }
  /// Number of gaps in the sequence numbers. Samples of several keys may be taken out of order; the count is
  /// correct once all are taken.
  std::uint64_t lost() const {
    std::uint64_t sum = 0;
    for (const KnownWriter& writer : writers_) sum += writer.last - writer.first + 1 - writer.count;
    return sum;
  }
  std::uint64_t rejected() const { return rejected_; }

 private:
  KnownWriter& find(const Guid& guid, std::uint64_t sequence) {
    for (KnownWriter& writer : writers_) {
      if (writer.guid == guid) return writer;
    }
    const std::string hash = participant_.idlHashOf(guid);
    const std::string& own_hash = participant_.hashFor(idl_hash_);
    const bool is_external = !hash.empty() && hash != own_hash;
    if (is_external && participant_.options().report) {
      participant_.options().report(topic_ + ": samples of a writer with another IDL are dropped (IDL hash " +
                                    hash.substr(0, 12) + " instead of " + own_hash.substr(0, 12) +
                                    "); build all services from the same idl/");
    }
    writers_.push_back({guid, writers_.size() + 1, is_external, sequence, sequence, 0});
    return writers_.back();
  }

  DdsParticipant& participant_;
  std::string topic_, idl_hash_;
  std::deque<KnownWriter> writers_;
  std::uint64_t rejected_ = 0;
};

}  // namespace omnifleet::bus
