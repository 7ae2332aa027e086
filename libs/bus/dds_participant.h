#pragma once

// Inside of DdsBus: one Fast DDS participant with its caches, and the settings of docs/methods.md, "DDS as
// measured".

#include <chrono>
#include <condition_variable>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "bus/dds_bus.h"
#include "bus/wake_event.h"

namespace omnifleet::bus {

namespace dds = eprosima::fastdds::dds;
using Guid = eprosima::fastrtps::rtps::GUID_t;

/// Shared by the bus and its endpoints; goes with the last of them.
class DdsParticipant : public dds::DomainParticipantListener {
 public:
  explicit DdsParticipant(DdsBusOptions options);
  ~DdsParticipant() override;

  const DdsBusOptions& options() const { return options_; }
  BusSignal& signal() { return signal_; }

  /// One per name; registers the type at first use. Takes the type support over.
  dds::Topic* topic(const std::string& name, dds::TypeSupport type);
  /// Partition is a publisher's QoS: one publisher (subscriber) per set of partitions.
  dds::Publisher* publisher(const std::vector<std::string>& partitions);
  dds::Subscriber* subscriber(const std::vector<std::string>& partitions);

  /// QoS of the project in DDS's terms; `idl_hash` travels in the endpoint's user data.
  dds::DataWriterQos writerQos(const QosProfile& qos, const std::string& idl_hash) const;
  dds::DataReaderQos readerQos(const QosProfile& qos) const;

  /// Of a discovered writer; empty for foreign vendors.
  std::string idlHashOf(const Guid& writer) const;
  /// What a type's hash is here: its own, or the one of the options.
  const std::string& hashFor(const std::string& type_hash) const;

  /// Writers that flush() waits for, until they are ended.
  void add(dds::DataWriter* writer);
  void end(dds::DataWriter* writer);
  bool flush(std::chrono::nanoseconds timeout);

  void on_participant_discovery(dds::DomainParticipant* participant,
                                eprosima::fastrtps::rtps::ParticipantDiscoveryInfo&& info) override;
  void on_subscriber_discovery(dds::DomainParticipant* participant,
                               eprosima::fastrtps::rtps::ReaderDiscoveryInfo&& info) override;
  void on_publisher_discovery(dds::DomainParticipant* participant,
                              eprosima::fastrtps::rtps::WriterDiscoveryInfo&& info) override;

 private:
  using Clock = std::chrono::steady_clock;
  using Prefix = eprosima::fastrtps::rtps::GuidPrefix_t;

  /// Another participant, as far as its readers are concerned.
  struct Peer {
    Clock::time_point found;
    bool readers_known = false;
  };
  /// Until no peer was found so lately that its readers may not be matched yet.
  void awaitReadersOfPeers(Clock::time_point until);
  bool anyReadersOnTheirWay() const;

  DdsBusOptions options_;
  BusSignal signal_;
  dds::DomainParticipant* participant_ = nullptr;
  std::map<std::string, dds::Topic*> topics_;
  std::map<std::vector<std::string>, dds::Publisher*> publishers_;
  std::map<std::vector<std::string>, dds::Subscriber*> subscribers_;
  std::set<dds::DataWriter*> writers_;
  mutable std::mutex mutex_;  ///< guards what follows: discovery runs in threads of DDS
  std::map<Guid, std::string> hashes_;
  std::map<Prefix, Peer> peers_;
  std::condition_variable peers_changed_;
};

/// Retries `attempt` while it says that there is no room yet, until the write timeout, or 0.2 s once
/// stopping; `meanwhile()` in between. Returns the last code. Each attempt blocks for up to the writer's
/// max_blocking_time.
template <class Attempt, class Meanwhile>
eprosima::fastrtps::types::ReturnCode_t retryWrite(DdsParticipant& participant, const Attempt& attempt,
                                                   const Meanwhile& meanwhile) {
  using Code = eprosima::fastrtps::types::ReturnCode_t;
  using Clock = std::chrono::steady_clock;
  const auto start = Clock::now();
  while (true) {
    const Code code = attempt();
    const bool full = code == Code::RETCODE_TIMEOUT || code == Code::RETCODE_OUT_OF_RESOURCES ||
                      code == Code::RETCODE_ERROR;
    const std::chrono::milliseconds limit =
        participant.signal().stop ? std::chrono::milliseconds(200) : participant.options().write_timeout;
    if (!full || Clock::now() - start >= limit) return code;
    meanwhile();
  }
}

/// "timeout", "out of resources", … for error texts.
const char* toString(const eprosima::fastrtps::types::ReturnCode_t& code);

// The two kinds of endpoints; see dds_endpoints.cpp and dds_frames.cpp.
std::unique_ptr<WriterPort> makeDdsWriter(std::shared_ptr<DdsParticipant> participant,
                                          const std::string& topic, const QosProfile& qos,
                                          const TypeDescriptor& type, const std::string& robot);
std::unique_ptr<ReaderPort> makeDdsReader(std::shared_ptr<DdsParticipant> participant,
                                          const std::string& topic, const QosProfile& qos,
                                          const TypeDescriptor& type, const std::string& robot);
std::unique_ptr<FrameWriter> makeDdsFrameWriter(std::shared_ptr<DdsParticipant> participant,
                                                const std::string& camera_id, std::size_t bytes_needed);
std::unique_ptr<FrameReader> makeDdsFrameReader(std::shared_ptr<DdsParticipant> participant,
                                                const std::string& camera_id, std::size_t bytes_needed);

}  // namespace omnifleet::bus
