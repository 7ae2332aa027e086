#include "world/dataset_service.h"

namespace omnifleet::services {
namespace {
using std::chrono::steady_clock;
constexpr int kRowsPerSpin = 64;
}  // namespace

DatasetWorldService::DatasetWorldService(const bus::ServiceContext& context, const fleet::Fleet& fleet)
    : context_(context), ends_(context) {
  dataset::Dataset recording = dataset::Dataset::open(fleet.dataset);
  for (const std::string& warning : recording.warnings) {
    status().dropped();
    status().error(warning);
    context.log->warn("{}", warning);
  }
  for (dataset::RobotRecording& robot : recording.robots) {
    if (robot.wheels.empty()) continue;
    streams_.push_back(std::make_unique<WheelStream>(WheelStream{
        robot.name,
        std::move(robot.wheels),
        0,
        {context.bus.writer(context.topics.wheels_odometry, robot.name), "wheels/odometry " + robot.name,
         fleet::expectedReaders(fleet, "wheels/odometry", robot.name)}}));
  }
}

std::vector<bus::Expectation> DatasetWorldService::expectations() const {
  std::vector<bus::Expectation> all;
  for (const auto& stream : streams_) all.push_back(stream->out.expectation());
  return all;
}

DatasetWorldService::WheelStream* DatasetWorldService::earliest() {
  WheelStream* first = nullptr;
  for (auto& stream : streams_) {
    if (stream->next == stream->rows.size()) continue;
    if (!first || stream->rows[stream->next].time_ns < first->rows[first->next].time_ns) first = stream.get();
  }
  return first;
}

bool DatasetWorldService::spin() {
  if (ended_) return false;
  for (int i = 0; i < kRowsPerSpin; ++i) {
    WheelStream* stream = earliest();
    if (!stream) {
      finish("");
      ended_ = true;
      return true;
    }
    const auto begun = steady_clock::now();
    const dataset::WheelRow& row = stream->rows[stream->next];
    sample_.robot(stream->robot);
    adapters::fillHeader(row.time_ns, static_cast<std::uint32_t>(stream->next), runClock(context_.options),
                         sample_.header());
    sample_.v_left_mps(row.left_mps);
    sample_.v_right_mps(row.right_mps);
    stream->out.write(sample_, status());
    ++stream->next;
    status().processed(steady_clock::now() - begun);
  }
  return true;
}

void DatasetWorldService::finish(const std::string& reason) {
  for (auto& stream : streams_) stream->out.end(ends_, reason);
}

}  // namespace omnifleet::services
