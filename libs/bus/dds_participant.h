#pragma once

// Internals of DdsBus: one Fast DDS participant with its caches. docs/methods/dds.md explains the settings.

#include <atomic>
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

/// Shared by the bus and its endpoints; destroyed with the last of them.
class DdsParticipant : public dds::DomainParticipantListener {
 public:
  explicit DdsParticipant(DdsBusOptions options);
  ~DdsParticipant() override;

  const DdsBusOptions& options() const { return options_; }
  BusSignal& signal() { return signal_; }

  /// One topic per name. Registers the type at first use and takes ownership of the type support.
  dds::Topic* topic(const std::string& name, dds::TypeSupport type);
  /// Partitions are a QoS of publishers: one publisher (subscriber) per set of partitions.
  dds::Publisher* publisher(const std::vector<std::string>& partitions);
  dds::Subscriber* subscriber(const std::vector<std::string>& partitions);

  /// The project's QoS as DDS QoS. `idl_hash` is sent in the user data of the endpoint.
  dds::DataWriterQos writerQos(const QosProfile& qos, const std::string& idl_hash) const;
  dds::DataReaderQos readerQos(const QosProfile& qos) const;

  /// Hash of a discovered writer; empty for other DDS vendors.
  std::string idlHashOf(const Guid& writer) const;
  /// The type's own hash, or options().idl_hash when that is set.
  const std::string& hashFor(const std::string& type_hash) const;

  /// Registers a writer for flush(), until end().
  void add(dds::DataWriter* writer);
  void end(dds::DataWriter* writer);
  bool flush(std::chrono::nanoseconds timeout);

  void countOut(std::size_t bytes) { bytes_out_ += bytes; }
  void countIn(std::size_t bytes) { bytes_in_ += bytes; }
  Traffic traffic() const { return {bytes_out_, bytes_in_}; }
  /// Bus::rival().
  std::string rival() const;
  /// The same as a cheap test: false if no other participant ever made the same claim.
  bool isOutranked() const { return any_rivals_ && !rival().empty(); }

  void on_participant_discovery(dds::DomainParticipant* participant,
                                eprosima::fastrtps::rtps::ParticipantDiscoveryInfo&& info) override;
  void on_subscriber_discovery(dds::DomainParticipant* participant,
                               eprosima::fastrtps::rtps::ReaderDiscoveryInfo&& info) override;
  void on_publisher_discovery(dds::DomainParticipant* participant,
                              eprosima::fastrtps::rtps::WriterDiscoveryInfo&& info) override;

 private:
  using Clock = std::chrono::steady_clock;
  using Prefix = eprosima::fastrtps::rtps::GuidPrefix_t;

  /// Another participant and whether its readers are known.
  struct Peer {
    Clock::time_point found;
    bool readers_known = false;
  };
  /// Waits until no recently discovered peer can have unmatched readers.
  void noteClaim(const eprosima::fastrtps::rtps::ParticipantDiscoveryInfo& info);
  void awaitReadersOfPeers(Clock::time_point until);
  bool anyReadersOnTheirWay() const;

  DdsBusOptions options_;
  BusSignal signal_;
  dds::DomainParticipant* participant_ = nullptr;
  std::map<std::string, dds::Topic*> topics_;
  std::map<std::vector<std::string>, dds::Publisher*> publishers_;
  std::map<std::vector<std::string>, dds::Subscriber*> subscribers_;
  std::set<dds::DataWriter*> writers_;
  mutable std::mutex mutex_;  ///< guards the members below: DDS threads run discovery
  std::map<Guid, std::string> hashes_;
  std::map<Prefix, Peer> peers_;
  std::map<Prefix, RobotClaim> rivals_;  ///< participants that claim the same stage of the same robot
  std::condition_variable peers_changed_;
  std::atomic<bool> any_rivals_{false};
  std::atomic<std::uint64_t> bytes_out_{0}, bytes_in_{0};
};

/// Retries `attempt` while the history is full, until the write timeout, or for 0.2 s after a stop request.
/// Calls `meanwhile()` between attempts. Each attempt blocks for up to max_blocking_time of the writer.
/// @return the last code
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

// The two kinds of endpoints: dds_endpoints.cpp and dds_frames.cpp.
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
