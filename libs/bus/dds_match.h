#pragma once

// What endpoints keep of their peers: how many match, who wrote what, who speaks another IDL.

#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>

#include <algorithm>
#include <atomic>
#include <deque>

#include "bus/dds_participant.h"

namespace omnifleet::bus {

/// Counts matches and wakes the bus; called from threads of DDS.
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
  void on_liveliness_changed(dds::DataReader*, const dds::LivelinessChangedStatus& status) override {
    alive = status.alive_count;
    signal.event.signal();
  }
  BusSignal& signal;
  std::atomic<int> matched{0};
  std::atomic<int> alive{0};
};

struct KnownWriter {
  Guid guid;
  std::uint64_t number = 0;                      ///< from 1, in order of first arrival
  bool stranger = false;                         ///< of another IDL
  std::uint64_t first = 0, last = 0, count = 0;  ///< sequence numbers seen
};

/// The writers that one reader has heard. Used by the reader's thread only.
class KnownWriters {
 public:
  KnownWriters(DdsParticipant& participant, std::string topic, std::string idl_hash)
      : participant_(participant), topic_(std::move(topic)), idl_hash_(std::move(idl_hash)) {}

  /// Accounts for one sample and tells who wrote it.
  const KnownWriter& arrived(const dds::SampleInfo& info) {
    const std::uint64_t sequence = info.sample_identity.sequence_number().to64long();
    KnownWriter& writer = find(info.sample_identity.writer_guid(), sequence);
    writer.first = std::min(writer.first, sequence);
    writer.last = std::max(writer.last, sequence);
    ++writer.count;
    if (writer.stranger) ++rejected_;
    return writer;
  }
  /// Gaps in the sequences. Samples of several keys may be taken out of order; it evens out when all are
  /// taken.
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
    const std::string& ours = participant_.hashFor(idl_hash_);
    const bool stranger = !hash.empty() && hash != ours;
    if (stranger && participant_.options().report) {
      participant_.options().report(topic_ + ": a writer was built from another IDL (theirs " +
                                    hash.substr(0, 12) + ", ours " + ours.substr(0, 12) +
                                    "): its samples are dropped");
    }
    writers_.push_back({guid, writers_.size() + 1, stranger, sequence, sequence, 0});
    return writers_.back();
  }

  DdsParticipant& participant_;
  std::string topic_, idl_hash_;
  std::deque<KnownWriter> writers_;
  std::uint64_t rejected_ = 0;
};

}  // namespace omnifleet::bus
