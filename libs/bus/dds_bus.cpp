#include "bus/dds_bus.h"

#include <unistd.h>

#include <array>

#include "bus/dds_participant.h"

namespace omnifleet::bus {
namespace {

std::string hostName() {
  std::array<char, 256> name{};
  return ::gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "localhost";
}

class DdsBus : public Bus {
 public:
  explicit DdsBus(DdsBusOptions options)
      : participant_(std::make_shared<DdsParticipant>(std::move(options))) {}

  std::unique_ptr<FrameWriter> frameWriter(const std::string& camera_id, std::size_t bytes_needed) override {
    return makeDdsFrameWriter(participant_, camera_id, bytes_needed);
  }
  std::unique_ptr<FrameReader> frameReader(const std::string& camera_id, std::size_t bytes_needed) override {
    return makeDdsFrameReader(participant_, camera_id, bytes_needed);
  }
  bool wait(std::chrono::nanoseconds timeout) override { return participant_->signal().event.wait(timeout); }
  void wake() noexcept override { participant_->signal().event.signal(); }
  void requestStop() noexcept override {
    participant_->signal().stop = true;
    participant_->signal().event.signal();
  }
  bool stopping() const noexcept override { return participant_->signal().stop; }
  bool flush(std::chrono::nanoseconds timeout) override { return participant_->flush(timeout); }
  Traffic traffic() const override { return participant_->traffic(); }
  std::string rival() const override { return participant_->rival(); }

 protected:
  std::unique_ptr<WriterPort> writerPort(const std::string& topic, const QosProfile& qos,
                                         const TypeDescriptor& type, const std::string& robot) override {
    return makeDdsWriter(participant_, topic, qos, type, robot);
  }
  std::unique_ptr<ReaderPort> readerPort(const std::string& topic, const QosProfile& qos,
                                         const TypeDescriptor& type, const std::string& robot) override {
    return makeDdsReader(participant_, topic, qos, type, robot);
  }

 private:
  std::shared_ptr<DdsParticipant> participant_;
};

}  // namespace

std::unique_ptr<Bus> makeDdsBus(const DdsBusOptions& options) {
  DdsBusOptions complete = options;
  if (complete.machine.empty()) complete.machine = hostName();
  return std::make_unique<DdsBus>(std::move(complete));
}

}  // namespace omnifleet::bus
