// Frames use data-sharing: written into a loan and read in place (0.2 ms per frame, 1.5 ms through a socket;
// docs/methods/dds.md).

#include <stdexcept>

#include "bus/dds_match.h"
#include "bus/dds_participant.h"
#include "bus/partition.h"
#include "bus/shared_memory.h"
#include "bus/shared_segments.h"
#include "bus/topics.h"
#include "idl/cameraPubSubTypes.h"
#include "idl/hashes.h"

namespace omnifleet::bus {
namespace {

using Code = eprosima::fastrtps::types::ReturnCode_t;

void encode(const FrameHeader& header, v1::FrameInfo& info) {
  const auto time = static_cast<std::uint64_t>(header.acquired_ns);
  info.acquired_ns_high(static_cast<std::uint32_t>(time >> 32));
  info.acquired_ns_low(static_cast<std::uint32_t>(time));
  info.clock(static_cast<std::uint32_t>(header.clock));
  info.sequence_number(header.sequence);
  info.state(static_cast<std::uint32_t>(header.state));
  info.width(static_cast<std::uint32_t>(header.width_px));
  info.height(static_cast<std::uint32_t>(header.height_px));
  info.channels(static_cast<std::uint32_t>(header.channels));
}

FrameHeader decode(const v1::FrameInfo& info) {
  FrameHeader header;
  header.acquired_ns = static_cast<TimeNs>((static_cast<std::uint64_t>(info.acquired_ns_high()) << 32) |
                                           info.acquired_ns_low());
  header.clock = static_cast<ClockId>(info.clock());
  header.sequence = info.sequence_number();
  header.state = static_cast<FrameState>(info.state());
  header.width_px = static_cast<int>(info.width());
  header.height_px = static_cast<int>(info.height());
  header.channels = static_cast<int>(info.channels());
  return header;
}

/// Location of a frame: what the reader takes instead of a copy. DDS loans are not used. Returning a loan
/// whose writer is gone is undefined, and a loan holds the slot no longer than a plain take
/// (docs/methods/dds.md).
struct FrameSlice {
  SharedSegments* segments = nullptr;
  const std::uint8_t* dds_sample = nullptr;  ///< in the mapping of DDS, which is gone with the writer
  const std::uint8_t* sample = nullptr;      ///< in the process's own mapping
};

/// The generated type support, but without a copy when reading.
template <class Support>
class SliceSupport : public Support {
 public:
  /// Called under the reader's lock, so the writer's segment is still mapped.
  bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t* payload, void* data) override {
    constexpr std::uint32_t kHeader =
        eprosima::fastrtps::rtps::SerializedPayload_t::representation_header_size;
    if (payload->length < kHeader + sizeof(typename Support::type)) return false;
    auto* slice = static_cast<FrameSlice*>(data);
    slice->dds_sample = payload->data + kHeader;
    slice->sample = slice->segments->keep(slice->dds_sample);
    return slice->sample != nullptr;
  }
};

template <class Support>
class DdsFrameWriter : public FrameWriter {
  using Frame = typename Support::type;
  static_assert(alignof(Frame) <= 4, "loaned samples are 4-byte aligned");

 public:
  DdsFrameWriter(std::shared_ptr<DdsParticipant> participant, const std::string& camera_id,
                 FrameClass frame_class)
      : participant_(std::move(participant)),
        listener_(participant_->signal()),
        name_(cameraTopicName(camera_id)),
        class_(frame_class) {
    const RunMode mode = participant_->options().mode;
    requireSharedMemory(frameChannelBytes(class_.capacity, mode));
    dds::Topic* topic = participant_->topic(name_, dds::TypeSupport(new SliceSupport<Support>()));
    writer_ =
        participant_->publisher(framePartitions(participant_->options().machine))
            ->create_datawriter(topic, participant_->writerQos(frameQos(mode), v1::kCameraHash), &listener_);
    if (writer_ == nullptr)
      throw std::runtime_error(name_ +
                               ": the DDS frame writer cannot be created; check the free space of /dev/shm");
    participant_->add(writer_);
  }
  ~DdsFrameWriter() override {
    abandon();
    participant_->end(writer_);
  }

  std::uint8_t* begin(const FrameHeader& header) override {
    abandon();
    error_.clear();
    if (!fits(header)) return nullptr;
    void* sample = nullptr;
    const auto kind = dds::DataWriter::LoanInitializationKind::NO_LOAN_INITIALIZATION;
    if (writer_->loan_sample(sample, kind) != Code::RETCODE_OK) return nullptr;
    open_ = static_cast<Frame*>(sample);
    encode(header, open_->info());
    return open_->data().data();
  }
  void amend(const FrameHeader& header) override {
    if (open_ == nullptr || !fits(header))
      throw std::runtime_error(name_ + ": the amended frame is larger than its loan");
    encode(header, open_->info());
  }
  bool publish() override {
    error_.clear();
    if (open_ == nullptr) {
      error_ = name_ + ": publish() without begin()";
      return false;
    }
    const auto attempt = [&] { return writer_->write(open_, eprosima::fastrtps::rtps::InstanceHandle_t()); };
    const Code code = retryWrite(*participant_, attempt, [] {});
    if (code != Code::RETCODE_OK) {
      error_ = name_ + ": " + toString(code);
      abandon();
      return false;
    }
    open_ = nullptr;
    return true;
  }
  void abandon() override {
    if (open_ == nullptr) return;
    void* sample = open_;
    writer_->discard_loan(sample);
    open_ = nullptr;
  }
  int matched() const override { return listener_.matched; }
  bool waitForReaders(int count, std::chrono::nanoseconds timeout) override {
    return participant_->signal().waitUntil([&] { return listener_.matched >= count; }, timeout);
  }
  const std::string& error() const override { return error_; }

 private:
  bool fits(const FrameHeader& header) {
    if (header.bytes() <= class_.capacity) return true;
    error_ = name_ + ": a frame of " + std::to_string(header.bytes()) + " bytes is larger than frame class " +
             class_.name;
    return false;
  }

  std::shared_ptr<DdsParticipant> participant_;
  WriterMatches listener_;
  std::string name_;
  FrameClass class_;
  dds::DataWriter* writer_ = nullptr;
  Frame* open_ = nullptr;
  std::string error_;
};

template <class Support>
class DdsFrameReader : public FrameReader {
  using Frame = typename Support::type;

 public:
  DdsFrameReader(std::shared_ptr<DdsParticipant> participant, const std::string& camera_id)
      : participant_(std::move(participant)),
        listener_(participant_->signal()),
        name_(cameraTopicName(camera_id)),
        writers_(*participant_, name_, v1::kCameraHash) {
    QosProfile qos = frameQos(participant_->options().mode);
    qos.reliable = qos.keep_all;  // live: best effort, because a late frame has no value
    dds::Topic* topic = participant_->topic(name_, dds::TypeSupport(new SliceSupport<Support>()));
    reader_ = participant_->subscriber(framePartitions(participant_->options().machine))
                  ->create_datareader(topic, participant_->readerQos(qos), &listener_);
    if (reader_ == nullptr)
      throw std::runtime_error(name_ +
                               ": the DDS frame reader cannot be created; check the free space of /dev/shm");
  }
  ~DdsFrameReader() override {
    release();
    reader_->set_listener(nullptr);
    const_cast<dds::Subscriber*>(reader_->get_subscriber())->delete_datareader(reader_);
  }

  std::optional<FrameView> take() override {
    if (holding_) return std::nullopt;
    FrameSlice slice{&segments_};
    while (reader_->take_next_sample(&slice, &info_) == Code::RETCODE_OK) {
      if (!info_.valid_data) continue;
      const KnownWriter& writer = writers_.arrived(info_);
      if (writer.is_external) continue;
      if (writer.number != writer_number_) {  // its segment may have the address of an earlier writer's
        segments_.clear();
        slice.sample = segments_.keep(slice.dds_sample);
        writer_number_ = writer.number;
      }
      if (slice.sample == nullptr) continue;
      hold(slice.sample);
      if (stillValid()) {
        ++received_;
        return FrameView{header_, frame_->data().data()};
      }
      release();
    }
    return std::nullopt;
  }
  bool stillValid() override {
    if (!holding_) return false;
    if (reader_->is_sample_valid(frame_, &info_)) return true;
    if (!torn_counted_) ++torn_;
    torn_counted_ = true;
    return false;
  }
  void release() override { holding_ = false; }
  bool holding() const override { return holding_; }
  int matched() const override { return listener_.matched; }
  bool waitForWriters(int count, std::chrono::nanoseconds timeout) override {
    return participant_->signal().waitUntil([&] { return listener_.matched >= count; }, timeout);
  }
  FrameCounters counters() const override { return {received_, writers_.lost(), torn_, writers_.rejected()}; }

 private:
  void hold(const std::uint8_t* sample) {
    frame_ = reinterpret_cast<const Frame*>(sample);
    header_ = decode(frame_->info());
    holding_ = true;
    torn_counted_ = false;
  }

  std::shared_ptr<DdsParticipant> participant_;
  ReaderMatches listener_;
  std::string name_;
  KnownWriters writers_;
  dds::DataReader* reader_ = nullptr;
  SharedSegments segments_;
  dds::SampleInfo info_;  ///< of the held frame
  const Frame* frame_ = nullptr;
  FrameHeader header_;
  std::uint64_t writer_number_ = 0;
  bool holding_ = false;
  bool torn_counted_ = false;
  std::uint64_t received_ = 0, torn_ = 0;
};

}  // namespace

std::unique_ptr<FrameWriter> makeDdsFrameWriter(std::shared_ptr<DdsParticipant> participant,
                                                const std::string& camera_id, std::size_t bytes_needed) {
  const FrameClass frame_class = frameClassFor(bytes_needed);
  const std::string name = frame_class.name;
  if (name == "Frame1M") {
    return std::make_unique<DdsFrameWriter<v1::Frame1MPubSubType>>(std::move(participant), camera_id,
                                                                   frame_class);
  }
  if (name == "Frame4M") {
    return std::make_unique<DdsFrameWriter<v1::Frame4MPubSubType>>(std::move(participant), camera_id,
                                                                   frame_class);
  }
  return std::make_unique<DdsFrameWriter<v1::Frame12MPubSubType>>(std::move(participant), camera_id,
                                                                  frame_class);
}

std::unique_ptr<FrameReader> makeDdsFrameReader(std::shared_ptr<DdsParticipant> participant,
                                                const std::string& camera_id, std::size_t bytes_needed) {
  const std::string name = frameClassFor(bytes_needed).name;
  if (name == "Frame1M")
    return std::make_unique<DdsFrameReader<v1::Frame1MPubSubType>>(std::move(participant), camera_id);
  if (name == "Frame4M")
    return std::make_unique<DdsFrameReader<v1::Frame4MPubSubType>>(std::move(participant), camera_id);
  return std::make_unique<DdsFrameReader<v1::Frame12MPubSubType>>(std::move(participant), camera_id);
}

}  // namespace omnifleet::bus
