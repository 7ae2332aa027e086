#include "tests/benchmark/raw_frames.h"

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastdds/rtps/transport/shared_mem/SharedMemTransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>
#include <fastdds/dds/core/condition/WaitSet.hpp>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <stdexcept>

#include "bus/frame_channel.h"
#include "idl/cameraPubSubTypes.h"

namespace omnifleet::bench {
namespace {

namespace dds = eprosima::fastdds::dds;
using Code = eprosima::fastrtps::types::ReturnCode_t;

constexpr std::uint32_t kSocketBuffer = 4u << 20, kSegment = 16u << 20;

/// Common interface of the frame types of different size.
struct AnyFrame {
  virtual ~AnyFrame() = default;
  virtual void* sample() = 0;
  virtual v1::FrameInfo& info() = 0;
  virtual std::uint8_t* pixels() = 0;
  dds::TypeSupport type;
};

template <class Support>
struct FrameOf : AnyFrame {
  FrameOf() : frame(std::make_unique<typename Support::type>()) { type = dds::TypeSupport(new Support()); }
  void* sample() override { return frame.get(); }
  v1::FrameInfo& info() override { return frame->info(); }
  std::uint8_t* pixels() override { return frame->data().data(); }
  std::unique_ptr<typename Support::type> frame;
};

std::unique_ptr<AnyFrame> frameFor(std::size_t bytes) {
  if (bus::frameClassFor(bytes).name == std::string("Frame1M"))
    return std::make_unique<FrameOf<v1::Frame1MPubSubType>>();
  return std::make_unique<FrameOf<v1::Frame4MPubSubType>>();
}

dds::DomainParticipantQos participantQos(RawTransport transport) {
  dds::DomainParticipantQos qos;
  auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList = {"127.0.0.1"};
  udp->sendBufferSize = udp->receiveBufferSize = kSocketBuffer;
  qos.transport().use_builtin_transports = false;
  qos.transport().send_socket_buffer_size = qos.transport().listen_socket_buffer_size = kSocketBuffer;
  qos.transport().user_transports.push_back(udp);
  if (transport == RawTransport::kSharedMemory) {
    auto shared = std::make_shared<eprosima::fastdds::rtps::SharedMemTransportDescriptor>();
    shared->segment_size(kSegment);
    qos.transport().user_transports.push_back(shared);  // Fast DDS prefers it on one host
  }
  return qos;
}

template <class Qos>
void setCommon(Qos& qos) {
  qos.reliability().kind = dds::RELIABLE_RELIABILITY_QOS;
  qos.durability().kind = dds::VOLATILE_DURABILITY_QOS;
  qos.history().kind = dds::KEEP_ALL_HISTORY_QOS;
  qos.resource_limits().max_samples = qos.resource_limits().max_samples_per_instance = 8;
  qos.resource_limits().max_instances = 1;
  qos.resource_limits().allocated_samples = 8;
  qos.data_sharing().off();
}

/// Participant, type and topic, common to writer and reader.
struct End {
  End(RawTransport transport, int domain, std::size_t bytes) : frame(frameFor(bytes)) {
    participant = dds::DomainParticipantFactory::get_instance()->create_participant(
        static_cast<std::uint32_t>(domain), participantQos(transport));
    if (participant == nullptr) throw std::runtime_error("raw frames: the DDS participant cannot be created");
    frame->type->auto_fill_type_information(false);
    frame->type->auto_fill_type_object(false);
    participant->register_type(frame->type);
    topic = participant->create_topic("raw_frames", frame->type.get_type_name(), dds::TOPIC_QOS_DEFAULT);
  }
  ~End() {
    participant->delete_contained_entities();
    dds::DomainParticipantFactory::get_instance()->delete_participant(participant);
  }
  std::unique_ptr<AnyFrame> frame;
  dds::DomainParticipant* participant = nullptr;
  dds::Topic* topic = nullptr;
};

bool waitFor(dds::Entity& entity, const dds::StatusMask& mask, int seconds) {
  entity.get_statuscondition().set_enabled_statuses(mask);
  dds::WaitSet waits;
  waits.attach_condition(entity.get_statuscondition());
  dds::ConditionSeq active;
  return waits.wait(active, eprosima::fastrtps::Duration_t(seconds, 0)) == Code::RETCODE_OK;
}

}  // namespace

struct RawFrameWriter::Impl : End {
  using End::End;
  dds::DataWriter* writer = nullptr;
};

RawFrameWriter::RawFrameWriter(RawTransport transport, int domain, std::size_t bytes)
    : impl_(std::make_unique<Impl>(transport, domain, bytes)) {
  dds::DataWriterQos qos;
  setCommon(qos);
  qos.reliable_writer_qos().times.heartbeatPeriod = eprosima::fastrtps::Duration_t(0, 4'000'000u);
  impl_->writer =
      impl_->participant->create_publisher(dds::PUBLISHER_QOS_DEFAULT)->create_datawriter(impl_->topic, qos);
  if (impl_->writer == nullptr) throw std::runtime_error("raw frames: the DDS writer cannot be created");
}
RawFrameWriter::~RawFrameWriter() = default;

std::uint8_t* RawFrameWriter::pixels() {
  return impl_->frame->pixels();
}

bool RawFrameWriter::write(std::int64_t stamp_ns) {
  v1::FrameInfo& info = impl_->frame->info();
  info.acquired_ns_high(static_cast<std::uint32_t>(static_cast<std::uint64_t>(stamp_ns) >> 32));
  info.acquired_ns_low(static_cast<std::uint32_t>(stamp_ns));
  constexpr int kTries = 50;  // up to 0.1 s each; a full history accepts the frame after an acknowledgement
  for (int n = 0; n < kTries; ++n) {
    if (impl_->writer->write(impl_->frame->sample())) return true;
  }
  return false;
}

bool RawFrameWriter::waitForReader(int seconds) {
  dds::PublicationMatchedStatus status;
  impl_->writer->get_publication_matched_status(status);
  return status.current_count > 0 || waitFor(*impl_->writer, dds::StatusMask::publication_matched(), seconds);
}

struct RawFrameReader::Impl : End {
  using End::End;
  dds::DataReader* reader = nullptr;
  dds::SampleInfo info;
};

RawFrameReader::RawFrameReader(RawTransport transport, int domain, std::size_t bytes)
    : impl_(std::make_unique<Impl>(transport, domain, bytes)) {
  dds::DataReaderQos qos;
  setCommon(qos);
  impl_->reader = impl_->participant->create_subscriber(dds::SUBSCRIBER_QOS_DEFAULT)
                      ->create_datareader(impl_->topic, qos);
  if (impl_->reader == nullptr) throw std::runtime_error("raw frames: the DDS reader cannot be created");
}
RawFrameReader::~RawFrameReader() = default;

bool RawFrameReader::take(std::int64_t& stamp_ns, const std::uint8_t*& pixels, int timeout_s) {
  while (impl_->reader->take_next_sample(impl_->frame->sample(), &impl_->info) != Code::RETCODE_OK ||
         !impl_->info.valid_data) {
    if (!impl_->reader->wait_for_unread_message(eprosima::fastrtps::Duration_t(timeout_s, 0))) return false;
  }
  const v1::FrameInfo& info = impl_->frame->info();
  stamp_ns = static_cast<std::int64_t>((static_cast<std::uint64_t>(info.acquired_ns_high()) << 32) |
                                       info.acquired_ns_low());
  pixels = impl_->frame->pixels();
  return true;
}

}  // namespace omnifleet::bench
