// Writers and readers of all topics except frames.

#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>

#include <algorithm>
#include <set>
#include <stdexcept>

#include "bus/dds_match.h"
#include "bus/dds_participant.h"
#include "bus/partition.h"

namespace omnifleet::bus {
namespace {

using Code = eprosima::fastrtps::types::ReturnCode_t;

class DdsWriterPort : public WriterPort {
 public:
  DdsWriterPort(std::shared_ptr<DdsParticipant> participant, const std::string& topic, const QosProfile& qos,
                const TypeDescriptor& type, const std::string& robot)
      : participant_(std::move(participant)),
        listener_(participant_->signal()),
        name_(topic),
        type_(type),
        max_instances_(qos.max_instances),
        off_host_(qos.off_host),
        while_outranked_(qos.while_outranked) {
    dds::Topic* dds_topic = participant_->topic(topic, dds::TypeSupport(type.support()));
    writer_ = participant_->publisher(writerPartitions(robot))
                  ->create_datawriter(dds_topic, participant_->writerQos(qos, type.idl_hash), &listener_);
    if (writer_ == nullptr) throw std::runtime_error(topic + ": the DDS writer cannot be created");
    participant_->add(writer_);
  }
  ~DdsWriterPort() override { participant_->end(writer_); }

  bool write(const void* sample) override {
    error_.clear();
    if (!while_outranked_ && participant_->isOutranked()) return true;
    if (!admit(sample)) return false;
    const auto attempt = [&] {
      return writer_->write(const_cast<void*>(sample), eprosima::fastrtps::rtps::InstanceHandle_t());
    };
    const Code code = retryWrite(*participant_, attempt, while_full_);
    if (code == Code::RETCODE_OK) {
      if (off_host_ && listener_.matched > 0) participant_->countOut(type_.size(sample));
      return true;
    }
    error_ = name_ + ": " + toString(code);
    return false;
  }
  void whileFull(std::function<void()> action) override { while_full_ = std::move(action); }
  int matched() const override { return listener_.matched; }
  bool waitForReaders(int count, std::chrono::nanoseconds timeout) override {
    return participant_->signal().waitUntil([&] { return listener_.matched >= count; }, timeout);
  }
  const std::string& error() const override { return error_; }

 private:
  /// DDS rejects keys beyond max_instances permanently, so a retry is useless.
  bool admit(const void* sample) {
    const std::string key = type_.key(sample);
    if (keys_.count(key) > 0) return true;
    if (static_cast<int>(keys_.size()) >= max_instances_) {
      error_ = name_ + ": more than " + std::to_string(max_instances_) + " keys (max_instances)";
      return false;
    }
    keys_.insert(key);
    return true;
  }

  std::shared_ptr<DdsParticipant> participant_;
  WriterMatches listener_;
  std::string name_;
  const TypeDescriptor& type_;
  int max_instances_;
  bool off_host_, while_outranked_;
  std::set<std::string> keys_;
  dds::DataWriter* writer_ = nullptr;
  std::function<void()> while_full_ = [] {};
  std::string error_;
};

class DdsReaderPort : public ReaderPort {
 public:
  DdsReaderPort(std::shared_ptr<DdsParticipant> participant, const std::string& topic, const QosProfile& qos,
                const TypeDescriptor& type, const std::string& robot)
      : participant_(std::move(participant)),
        listener_(participant_->signal()),
        writers_(*participant_, topic, type.idl_hash),
        type_(type),
        off_host_(qos.off_host) {
    dds::Topic* dds_topic = participant_->topic(topic, dds::TypeSupport(type.support()));
    reader_ = participant_->subscriber(readerPartitions(robot))
                  ->create_datareader(dds_topic, participant_->readerQos(qos), &listener_);
    if (reader_ == nullptr) throw std::runtime_error(topic + ": the DDS reader cannot be created");
  }
  ~DdsReaderPort() override {
    reader_->set_listener(nullptr);
    const_cast<dds::Subscriber*>(reader_->get_subscriber())->delete_datareader(reader_);
  }

  bool take(void* sample, SampleInfo& info) override {
    dds::SampleInfo dds_info;
    while (reader_->take_next_sample(sample, &dds_info) == Code::RETCODE_OK) {
      if (!dds_info.valid_data) continue;  // a writer has left; there is no sample
      const KnownWriter& writer = writers_.arrived(dds_info);
      if (writer.is_external) continue;
      info.writer = writer.number;
      info.source_ns = dds_info.source_timestamp.to_ns();
      ++received_;
      if (off_host_) participant_->countIn(type_.size(sample));
      return true;
    }
    return false;
  }
  int matched() const override { return listener_.matched; }
  bool waitForWriters(int count, std::chrono::nanoseconds timeout) override {
    return participant_->signal().waitUntil([&] { return listener_.matched >= count; }, timeout);
  }
  ReaderCounters counters() const override { return {received_, writers_.lost(), writers_.rejected()}; }

 private:
  std::shared_ptr<DdsParticipant> participant_;
  ReaderMatches listener_;
  KnownWriters writers_;
  const TypeDescriptor& type_;
  bool off_host_;
  std::uint64_t received_ = 0;
  dds::DataReader* reader_ = nullptr;
};

}  // namespace

std::unique_ptr<WriterPort> makeDdsWriter(std::shared_ptr<DdsParticipant> participant,
                                          const std::string& topic, const QosProfile& qos,
                                          const TypeDescriptor& type, const std::string& robot) {
  return std::make_unique<DdsWriterPort>(std::move(participant), topic, qos, type, robot);
}

std::unique_ptr<ReaderPort> makeDdsReader(std::shared_ptr<DdsParticipant> participant,
                                          const std::string& topic, const QosProfile& qos,
                                          const TypeDescriptor& type, const std::string& robot) {
  return std::make_unique<DdsReaderPort>(std::move(participant), topic, qos, type, robot);
}

}  // namespace omnifleet::bus
