#include "bus/dds_log.h"

#include <fastdds/dds/log/Log.hpp>

#include <memory>
#include <set>
#include <utility>

namespace omnifleet::bus {
namespace {

namespace dds_log = eprosima::fastdds::dds;

class RedirectedLog : public dds_log::LogConsumer {
 public:
  explicit RedirectedLog(std::function<void(const std::string&)> write) : write_(std::move(write)) {}

  void Consume(const dds_log::Log::Entry& entry) override {
    constexpr std::size_t kMost = 200;  // different texts; some contain an identifier
    const std::string category = entry.context.category == nullptr ? "" : entry.context.category;
    const std::string line = "DDS (" + category + "): " + entry.message;
    if (!write_ || written_.size() >= kMost || !written_.insert(line).second) return;
    write_(line);
  }

 private:
  std::function<void(const std::string&)> write_;
  std::set<std::string> written_;
};

}  // namespace

void redirectDdsLog(std::function<void(const std::string&)> write) {
  dds_log::Log::ClearConsumers();
  dds_log::Log::RegisterConsumer(std::make_unique<RedirectedLog>(std::move(write)));
}

}  // namespace omnifleet::bus
