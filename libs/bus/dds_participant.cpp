#include "bus/dds_participant.h"

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>
#include <fastrtps/xmlparser/XMLProfileManager.h>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>

#include <algorithm>
#include <stdexcept>

#include "bus/interfaces.h"
#include "bus/shared_memory.h"

namespace omnifleet::bus {
namespace {

using eprosima::fastrtps::Duration_t;
using eprosima::fastrtps::rtps::IPLocator;
using eprosima::fastrtps::rtps::Locator_t;

const std::string kHashTag = "omnifleet.idl=";
constexpr std::chrono::milliseconds kSlice{20};             // of a wait that a stop may end
constexpr std::chrono::milliseconds kDiscoveryAtStop{500};  // limit for discovery after a stop request

Duration_t toDuration(std::chrono::nanoseconds value) {
  const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(value);
  return Duration_t(static_cast<int32_t>(seconds.count()), static_cast<uint32_t>((value - seconds).count()));
}

Locator_t udpLocator(const std::string& address, std::uint32_t port) {
  Locator_t locator;
  locator.kind = LOCATOR_KIND_UDPv4;
  IPLocator::setIPv4(locator, address);
  locator.port = port;
  return locator;
}

/// Makes two buses in one process communicate as two processes do. Otherwise tests would use another delivery
/// path.
void disableIntraprocessDelivery() {
  eprosima::fastrtps::LibrarySettingsAttributes settings;
  settings.intraprocess_delivery = eprosima::fastrtps::INTRAPROCESS_OFF;
  eprosima::fastrtps::xmlparser::XMLProfileManager::library_settings(settings);
}

/// The addresses that this participant announces. Beside network addresses it does not announce loopback:
/// other hosts would send to themselves, and Fast DDS itself replaces an own network address by loopback.
std::vector<std::string> announced(const DdsBusOptions& options) {
  std::vector<std::string> addresses;
  for (const std::string& address : options.interfaces)
    if (!isLoopback(address)) addresses.push_back(address);
  return addresses.empty() ? options.interfaces : addresses;
}

void setTransport(dds::DomainParticipantQos& qos, const DdsBusOptions& options) {
  auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList = options.interfaces;
  if (std::none_of(options.interfaces.begin(), options.interfaces.end(), isLoopback))
    udp->interfaceWhiteList.push_back("127.0.0.1");
  udp->sendBufferSize = options.socket_buffer_bytes;
  udp->receiveBufferSize = options.socket_buffer_bytes;
  udp->maxMessageSize = options.max_message_bytes;
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(udp);
  qos.transport().send_socket_buffer_size = options.socket_buffer_bytes;
  qos.transport().listen_socket_buffer_size = options.socket_buffer_bytes;
}

/// Discovery uses UDP on the allowed interfaces. A restarted peer matches again within milliseconds
/// (docs/methods/dds.md).
void setDiscovery(dds::DomainParticipantQos& qos, const DdsBusOptions& options) {
  auto& builtin = qos.wire_protocol().builtin;
  builtin.discovery_config.leaseDuration = toDuration(options.lease);
  builtin.discovery_config.leaseDuration_announcementperiod = toDuration(options.announcement);
  for (const std::string& address : announced(options)) {
    builtin.metatrafficUnicastLocatorList.push_back(udpLocator(address, 0));
    qos.wire_protocol().default_unicast_locator_list.push_back(udpLocator(address, 0));
  }
  // Ports by the rules of RTPS (DDSI-RTPS 2.2, 9.6.1.1).
  const auto port = static_cast<std::uint32_t>(7400 + 250 * options.domain);
  const Locator_t multicast = udpLocator("239.255.0.1", port);
  builtin.metatrafficMulticastLocatorList.push_back(multicast);
  if (options.peers.empty()) return;
  builtin.initialPeersList.push_back(multicast);
  for (const std::string& peer : options.peers) {
    for (int i = 0; i < options.participants_per_peer; ++i)
      builtin.initialPeersList.push_back(udpLocator(peer, port + 10 + 2 * static_cast<std::uint32_t>(i)));
  }
}

dds::DomainParticipantQos participantQos(const DdsBusOptions& options) {
  dds::DomainParticipantQos qos;
  qos.name(options.name);
  setTransport(qos, options);
  setDiscovery(qos, options);
  if (options.claim) {
    const std::string text = options.claim->userData();
    qos.user_data().data_vec(std::vector<eprosima::fastrtps::rtps::octet>(text.begin(), text.end()));
  }
  return qos;
}

template <class EndpointQos>
void setCommon(EndpointQos& out, const QosProfile& qos) {
  out.reliability().kind = qos.reliable ? dds::RELIABLE_RELIABILITY_QOS : dds::BEST_EFFORT_RELIABILITY_QOS;
  out.durability().kind =
      qos.transient_local ? dds::TRANSIENT_LOCAL_DURABILITY_QOS : dds::VOLATILE_DURABILITY_QOS;
  out.history().kind = qos.keep_all ? dds::KEEP_ALL_HISTORY_QOS : dds::KEEP_LAST_HISTORY_QOS;
  out.history().depth = qos.depth;
  auto& limits = out.resource_limits();
  limits.max_instances = qos.max_instances;
  limits.max_samples_per_instance = qos.max_samples_per_instance;
  limits.max_samples = qos.maxSamples();
  limits.allocated_samples = std::min(qos.maxSamples(), 8);
  // Types are bounded by megabytes but use kilobytes, so memory grows as needed and is reused. Data-sharing
  // needs all memory in advance.
  out.endpoint().history_memory_policy = qos.data_sharing
                                             ? eprosima::fastrtps::rtps::PREALLOCATED_MEMORY_MODE
                                             : eprosima::fastrtps::rtps::DYNAMIC_REUSABLE_MEMORY_MODE;
  if (qos.data_sharing) {
    limits.extra_samples = kExtraFrameSlots;
    out.data_sharing().on("");
  } else {
    out.data_sharing().off();
  }
}

template <class GroupQos>
GroupQos inPartitions(GroupQos qos, const std::vector<std::string>& partitions) {
  if (partitions == std::vector<std::string>{""}) return qos;
  for (const std::string& partition : partitions) qos.partition().push_back(partition.c_str());
  return qos;
}

}  // namespace

DdsParticipant::DdsParticipant(DdsBusOptions options) : options_(std::move(options)) {
  disableIntraprocessDelivery();
  peers_[Prefix()].found =
      Clock::now();  // stands for participants that existed before and are not discovered yet
  participant_ = dds::DomainParticipantFactory::get_instance()->create_participant(
      static_cast<uint32_t>(options_.domain), participantQos(options_), this, dds::StatusMask::none());
  if (participant_ == nullptr) {
    throw std::runtime_error("cannot create a DDS participant in domain " + std::to_string(options_.domain) +
                             " on " +
                             (options_.interfaces.empty() ? "any interface" : options_.interfaces.front()));
  }
}

DdsParticipant::~DdsParticipant() {
  participant_->set_listener(nullptr);
  participant_->delete_contained_entities();
  dds::DomainParticipantFactory::get_instance()->delete_participant(participant_);
}

dds::Topic* DdsParticipant::topic(const std::string& name, dds::TypeSupport type) {
  const auto known = topics_.find(name);
  if (known != topics_.end()) {
    if (known->second->get_type_name() == type.get_type_name()) return known->second;
    throw std::runtime_error(name + ": the topic already has type " + known->second->get_type_name() +
                             ", not " + type.get_type_name());
  }
  type->auto_fill_type_information(false);  // other vendors reject endpoints that carry this information
  type->auto_fill_type_object(false);
  participant_->register_type(type);
  dds::Topic* created = participant_->create_topic(name, type.get_type_name(), dds::TOPIC_QOS_DEFAULT);
  if (created == nullptr) throw std::runtime_error(name + ": the DDS topic cannot be created");
  return topics_[name] = created;
}

dds::Publisher* DdsParticipant::publisher(const std::vector<std::string>& partitions) {
  dds::Publisher*& cached = publishers_[partitions];
  if (cached == nullptr)
    cached = participant_->create_publisher(inPartitions(dds::PublisherQos(), partitions));
  if (cached == nullptr)
    throw std::runtime_error("cannot create a DDS publisher in partition " + partitions.back());
  return cached;
}

dds::Subscriber* DdsParticipant::subscriber(const std::vector<std::string>& partitions) {
  dds::Subscriber*& cached = subscribers_[partitions];
  if (cached == nullptr)
    cached = participant_->create_subscriber(inPartitions(dds::SubscriberQos(), partitions));
  if (cached == nullptr)
    throw std::runtime_error("cannot create a DDS subscriber in partition " + partitions.back());
  return cached;
}

dds::DataWriterQos DdsParticipant::writerQos(const QosProfile& qos, const std::string& idl_hash) const {
  dds::DataWriterQos out;
  setCommon(out, qos);
  out.reliability().max_blocking_time = toDuration(std::chrono::milliseconds(20));
  auto& times = out.reliable_writer_qos().times;
  // A full keep-all history waits for the acknowledgement that the next heartbeat requests.
  const std::chrono::milliseconds soon{4};
  times.heartbeatPeriod = toDuration(qos.keep_all ? std::min(options_.heartbeat, soon) : options_.heartbeat);
  // A reader with a full history rejects samples and requests them again at every heartbeat. Each request
  // resends all 64 waiting samples. The delay of 10 ms limits this load, and a reader that has caught up does
  // not notice it.
  const bool resent_in_full = qos.keep_all && !qos.data_sharing;
  times.nackResponseDelay = toDuration(std::chrono::milliseconds(resent_in_full ? 10 : 1));
  if (options_.announce_hash) {
    const std::string text = kHashTag + hashFor(idl_hash);
    out.user_data().data_vec(std::vector<eprosima::fastrtps::rtps::octet>(text.begin(), text.end()));
  }
  return out;
}

dds::DataReaderQos DdsParticipant::readerQos(const QosProfile& qos) const {
  dds::DataReaderQos out;
  setCommon(out, qos);
  auto& times = out.reliable_reader_qos().times;
  times.heartbeatResponseDelay = toDuration(std::chrono::milliseconds(1));
  times.initialAcknackDelay = toDuration(std::chrono::milliseconds(5));
  return out;
}

const std::string& DdsParticipant::hashFor(const std::string& type_hash) const {
  return options_.idl_hash.empty() ? type_hash : options_.idl_hash;
}

std::string DdsParticipant::idlHashOf(const Guid& writer) const {
  std::lock_guard<std::mutex> lock(mutex_);
  const auto found = hashes_.find(writer);
  return found == hashes_.end() ? std::string() : found->second;
}

void DdsParticipant::on_publisher_discovery(dds::DomainParticipant*,
                                            eprosima::fastrtps::rtps::WriterDiscoveryInfo&& info) {
  using Info = eprosima::fastrtps::rtps::WriterDiscoveryInfo;
  std::lock_guard<std::mutex> lock(mutex_);
  if (info.status == Info::REMOVED_WRITER) {
    hashes_.erase(info.info.guid());
    return;
  }
  const auto& data = info.info.m_qos.m_userData.data_vec();
  const std::string text(data.begin(), data.end());
  if (text.rfind(kHashTag, 0) == 0) hashes_[info.info.guid()] = text.substr(kHashTag.size());
}

void DdsParticipant::on_participant_discovery(dds::DomainParticipant*,
                                              eprosima::fastrtps::rtps::ParticipantDiscoveryInfo&& info) {
  using Info = eprosima::fastrtps::rtps::ParticipantDiscoveryInfo;
  std::lock_guard<std::mutex> lock(mutex_);
  const Prefix& prefix = info.info.m_guid.guidPrefix;
  if (info.status == Info::DISCOVERED_PARTICIPANT) peers_.emplace(prefix, Peer{Clock::now()});
  if (info.status == Info::REMOVED_PARTICIPANT || info.status == Info::DROPPED_PARTICIPANT)
    peers_.erase(prefix);
  peers_changed_.notify_all();
  noteClaim(info);
}

/// The caller holds the mutex.
void DdsParticipant::noteClaim(const eprosima::fastrtps::rtps::ParticipantDiscoveryInfo& info) {
  using Info = eprosima::fastrtps::rtps::ParticipantDiscoveryInfo;
  if (!options_.claim) return;
  const Prefix& prefix = info.info.m_guid.guidPrefix;
  if (info.status == Info::REMOVED_PARTICIPANT || info.status == Info::DROPPED_PARTICIPANT) {
    if (rivals_.erase(prefix) > 0) signal_.event.signal();
    return;
  }
  const auto& data = info.info.m_userData.data_vec();
  const auto claim = RobotClaim::parse(std::string(data.begin(), data.end()));
  if (!claim || !claim->isSameStage(*options_.claim)) return;
  rivals_[prefix] = *claim;
  any_rivals_ = true;
  signal_.event.signal();
}

std::string DdsParticipant::rival() const {
  if (!any_rivals_) return {};
  const auto idOf = [](const Prefix& prefix) {
    return std::string(reinterpret_cast<const char*>(prefix.value), Prefix::size);
  };
  const std::string own_id = idOf(participant_->guid().guidPrefix);
  std::lock_guard<std::mutex> lock(mutex_);
  for (const auto& [prefix, claim] : rivals_) {
    if (outranks(claim, idOf(prefix), *options_.claim, own_id) && claim.isAlive(*options_.claim))
      return claim.describe();
  }
  return {};
}

void DdsParticipant::on_subscriber_discovery(dds::DomainParticipant*,
                                             eprosima::fastrtps::rtps::ReaderDiscoveryInfo&& info) {
  std::lock_guard<std::mutex> lock(mutex_);
  const auto peer = peers_.find(info.info.guid().guidPrefix);
  if (peer != peers_.end()) peer->second.readers_known = true;
  peers_changed_.notify_all();
}

bool DdsParticipant::anyReadersOnTheirWay() const {
  // Fast DDS announces endpoints right after the participant, and repeats lost announcements after one
  // second.
  constexpr std::chrono::milliseconds kReportAgain{1200};
  const auto now = Clock::now();
  return std::any_of(peers_.begin(), peers_.end(), [&](const auto& peer) {
    return !peer.second.readers_known && now - peer.second.found < kReportAgain;
  });
}

void DdsParticipant::awaitReadersOfPeers(Clock::time_point until) {
  std::unique_lock<std::mutex> lock(mutex_);
  bool waited = false;
  while (anyReadersOnTheirWay() && Clock::now() < until) {
    peers_changed_.wait_for(lock, kSlice);
    waited = true;
  }
  // A reader is announced before it is matched, and the readers of one participant are announced one by one.
  if (waited) peers_changed_.wait_for(lock, kSlice, [] { return false; });
}

void DdsParticipant::add(dds::DataWriter* writer) {
  writers_.insert(writer);
}

void DdsParticipant::end(dds::DataWriter* writer) {
  writers_.erase(writer);
  writer->set_listener(nullptr);
  // Fast DDS 2.9 returns the rest of the history to its pool while heartbeats may still iterate over it:
  // about one of 3000 writers never ended. An empty history avoids this.
  std::size_t cleared = 0;
  writer->clear_history(&cleared);
  const_cast<dds::Publisher*>(writer->get_publisher())->delete_datawriter(writer);
}

bool DdsParticipant::flush(std::chrono::nanoseconds timeout) {
  const std::chrono::nanoseconds discovery =
      signal_.stop ? std::min<std::chrono::nanoseconds>(timeout, kDiscoveryAtStop) : timeout;
  awaitReadersOfPeers(Clock::now() + discovery);
  const auto start = Clock::now();
  for (dds::DataWriter* writer : writers_) {
    while (writer->wait_for_acknowledgments(toDuration(kSlice)) !=
           eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) {
      const std::chrono::nanoseconds limit =
          signal_.stop ? std::min<std::chrono::nanoseconds>(timeout, std::chrono::milliseconds(200))
                       : timeout;
      if (Clock::now() - start >= limit) return false;
    }
  }
  return true;
}

const char* toString(const eprosima::fastrtps::types::ReturnCode_t& code) {
  using Code = eprosima::fastrtps::types::ReturnCode_t;
  if (code == Code::RETCODE_TIMEOUT) return "timeout: a reader is too slow";
  if (code == Code::RETCODE_OUT_OF_RESOURCES) return "out of resources";
  if (code == Code::RETCODE_PRECONDITION_NOT_MET) return "precondition not met";
  if (code == Code::RETCODE_BAD_PARAMETER) return "bad parameter";
  if (code == Code::RETCODE_NOT_ENABLED) return "not enabled";
  return "rejected: a history is full";
}

}  // namespace omnifleet::bus
