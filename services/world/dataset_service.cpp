#include "world/dataset_service.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "dataset/observation_rows.h"

namespace omnifleet::services {
namespace {
using std::chrono::steady_clock;
constexpr int kRowsPerSpin = 64;
constexpr std::size_t kMaxValues = 64;  // bound of one sample in localizer.idl
}  // namespace

/// One stream of the recording with its writer.
class DatasetWorldService::Stream {
 public:
  virtual ~Stream() = default;
  virtual bool done() const = 0;
  virtual TimeNs time() const = 0;  ///< of the next sample
  virtual void write(bus::StatusBoard& status) = 0;
  virtual void end(RunEnds& ends, const std::string& reason) = 0;
  virtual bus::Expectation expectation() const = 0;
};

class DatasetWorldService::WheelStream final : public Stream {
 public:
  WheelStream(const bus::ServiceContext& context, const fleet::Fleet& fleet, dataset::RobotRecording& robot)
      : rows_(std::move(robot.wheels)),
        clock_(runClock(context.options, fleet)),
        out_(context.bus.writer(context.topics.wheels_odometry, robot.name), "wheels/odometry " + robot.name,
             fleet::expectedReaders(fleet, "wheels/odometry", robot.name)) {
    sample_.robot(robot.name);
  }
  bool done() const override { return next_ == rows_.size(); }
  TimeNs time() const override { return rows_[next_].time_ns; }
  void write(bus::StatusBoard& status) override {
    const dataset::WheelRow& row = rows_[next_];
    adapters::fillHeader(row.time_ns, static_cast<std::uint32_t>(next_++), clock_, sample_.header());
    sample_.v_left_mps(row.left_mps);
    sample_.v_right_mps(row.right_mps);
    out_.write(sample_, status);
  }
  void end(RunEnds& ends, const std::string& reason) override { out_.end(ends, reason); }
  bus::Expectation expectation() const override { return out_.expectation(); }

 private:
  std::vector<dataset::WheelRow> rows_;
  adapters::RunClock clock_;
  Outlet<v1::WheelOdometry> out_;
  v1::WheelOdometry sample_;
  std::size_t next_ = 0;
};

class DatasetWorldService::LaserStream final : public Stream {
 public:
  LaserStream(const bus::ServiceContext& context, const fleet::Fleet& fleet, dataset::RobotRecording& robot)
      : robot_(robot.name),
        range_max_m_(robot.laser_sensor.range_max_m),
        rows_(std::move(robot.laser)),
        clock_(runClock(context.options, fleet)),
        out_(context.bus.writer(context.topics.laser, robot.name), "laser " + robot.name,
             fleet::expectedReaders(fleet, "laser", robot.name)) {}
  bool done() const override { return next_ == rows_.size(); }
  TimeNs time() const override { return rows_[next_].time_ns; }
  void write(bus::StatusBoard& status) override {
    adapters::toWire(rows_[next_], robot_, static_cast<std::uint32_t>(next_), range_max_m_, clock_, sample_);
    out_.write(sample_, status);
    ++next_;
  }
  void end(RunEnds& ends, const std::string& reason) override { out_.end(ends, reason); }
  bus::Expectation expectation() const override { return out_.expectation(); }

 private:
  std::string robot_;
  double range_max_m_;
  std::vector<dataset::LaserRow> rows_;
  adapters::RunClock clock_;
  Outlet<v1::LaserScan> out_;
  v1::LaserScan sample_;
  std::size_t next_ = 0;
};

class DatasetWorldService::ObservationStream final : public Stream {
 public:
  ObservationStream(const bus::ServiceContext& context, const fleet::Fleet& fleet,
                    dataset::RobotRecording& robot)
      : robot_(robot.name),
        rows_(std::move(robot.observations)),
        noise_(dataset::ObservationNoise::read(fleet.service("world").child("observations"))),
        clock_(runClock(context.options, fleet)),
        out_(context.bus.writer(context.topics.measurement, "observations/" + robot.name),
             "measurement observations/" + robot.name,
             fleet::expectedReaders(fleet, "measurement", "observations/" + robot.name)) {}
  bool done() const override { return next_ == rows_.size(); }
  TimeNs time() const override { return rows_[next_].time_ns; }
  void write(bus::StatusBoard& status) override {
    std::size_t end = next_ + 1;
    while (end < rows_.size() && rows_[end].time_ns == time()) ++end;
    if (end - next_ > kMaxValues) {
      status.dropped();
      status.report({ErrorCode::kRowsRejected,
                     robot_ + ": more than 64 observations at one time; the rest of them is ignored"});
    }
    const auto values =
        dataset::measurementsOf(robot_, &rows_[next_], std::min(end - next_, kMaxValues), noise_);
    adapters::toWire("observations/" + robot_, time(), sequence_++, FrameState::kOk, values, clock_, sample_);
    out_.write(sample_, status);
    next_ = end;
  }
  void end(RunEnds& ends, const std::string& reason) override { out_.end(ends, reason); }
  bus::Expectation expectation() const override { return out_.expectation(); }

 private:
  std::string robot_;
  std::vector<dataset::RangeBearingRow> rows_;
  dataset::ObservationNoise noise_;
  adapters::RunClock clock_;
  Outlet<v1::Measurement> out_;
  v1::Measurement sample_;
  std::size_t next_ = 0;
  std::uint32_t sequence_ = 0;
};

DatasetWorldService::DatasetWorldService(const bus::ServiceContext& context, const fleet::Fleet& fleet)
    : context_(context), ends_(context, runClock(context.options, fleet)) {
  dataset::Dataset recording = dataset::Dataset::open(fleet.dataset);
  reportWarnings(recording.warnings);
  for (dataset::RobotRecording& robot : recording.robots) {
    if (!robot.wheels.empty()) streams_.push_back(std::make_unique<WheelStream>(context, fleet, robot));
    if (!robot.laser.empty()) streams_.push_back(std::make_unique<LaserStream>(context, fleet, robot));
    if (!robot.observations.empty())
      streams_.push_back(std::make_unique<ObservationStream>(context, fleet, robot));
  }
}

/// Logs each warning. The status keeps the last message, which therefore counts the others.
void DatasetWorldService::reportWarnings(const std::vector<std::string>& warnings) {
  if (warnings.empty()) return;
  const std::size_t others = warnings.size() - 1;
  status().dropped(warnings.size());
  for (std::size_t i = 1; i <= others; ++i) status().report({ErrorCode::kRowsRejected, warnings[i]});
  status().report({ErrorCode::kRowsRejected,
                   warnings.front() + (others > 0 ? fmt::format("; {} more in the log", others) : "")});
}

DatasetWorldService::~DatasetWorldService() = default;

std::vector<bus::Expectation> DatasetWorldService::expectations() const {
  std::vector<bus::Expectation> all;
  for (const auto& stream : streams_) all.push_back(stream->expectation());
  return all;
}

DatasetWorldService::Stream* DatasetWorldService::earliest() {
  Stream* first = nullptr;
  for (auto& stream : streams_) {
    if (!stream->done() && (!first || stream->time() < first->time())) first = stream.get();
  }
  return first;
}

bool DatasetWorldService::spin() {
  if (ended_) return false;
  for (int i = 0; i < kRowsPerSpin; ++i) {
    Stream* stream = earliest();
    if (!stream) {
      finish("");
      ended_ = true;
      return true;
    }
    const auto begun = steady_clock::now();
    stream->write(status());
    status().processed(steady_clock::now() - begun);
  }
  return true;
}

void DatasetWorldService::finish(const std::string& reason) {
  for (auto& stream : streams_) stream->end(ends_, reason);
}

}  // namespace omnifleet::services
