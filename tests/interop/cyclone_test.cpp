// DDS of another vendor reads a running fleet: every field must equal what the project's own reader receives.

#include <gtest/gtest.h>

#include <cinttypes>
#include <cstdarg>
#include <set>
#include <sstream>

#include "tests/multiprocess/listener.h"
#include "tests/multiprocess/process.h"

namespace omnifleet::test {
namespace {

using namespace std::chrono_literals;

/// The lines of cyclone_subscriber.c, printed from the samples of the project's own reader.
class Line {
 public:
  Line& put(const char* format, ...) __attribute__((format(printf, 2, 3))) {
    char buffer[256];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(buffer, sizeof(buffer), format, arguments);
    va_end(arguments);
    text_ += buffer;
    return *this;
  }
  void header(const v1::Header& h) {
    put(" %" PRId64 " %" PRId64 " %d %u", static_cast<std::int64_t>(h.acquired_ns()),
        static_cast<std::int64_t>(h.published_ns()), static_cast<int>(h.clock()), h.sequence_number());
  }
  void point(const v1::Point2& p) { put(" %.17g %.17g", p.x(), p.y()); }
  template <class Array>
  void doubles(const Array& values) {
    for (const double value : values) put(" %.17g", value);
  }
  void floats(const std::vector<float>& values) {
    put(" %zu", values.size());
    for (const float value : values) put(" %.9g", static_cast<double>(value));
  }
  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

std::string lineOf(const v1::Pose& p) {
  Line line;
  line.put("pose %s", p.robot().c_str()).header(p.header());
  line.put(" %d %.17g %.17g %.17g", p.valid(), p.map_from_base().x(), p.map_from_base().y(),
           p.map_from_base().theta());
  line.doubles(p.covariance());
  line.put(" %zu", p.sightings().size());
  for (const v1::Sighting& s : p.sightings()) line.put(" %u %s", s.track_id(), s.robot().c_str());
  line.put(" %u %zu", p.term(), p.published().size());
  for (const v1::PublishedPose& other : p.published())
    line.put(" %s %lld", other.robot().c_str(), static_cast<long long>(other.last_ns()));
  return line.text();
}

void put(Line& line, const v1::Track& t) {
  line.put(" | %u %d %.9g %d", t.id(), static_cast<int>(t.kind()), static_cast<double>(t.kind_probability()),
           t.visible());
  line.point(t.position());
  line.point(t.velocity());
  line.doubles(t.covariance());
  line.point(t.contact());
  line.put(" %zu", t.hull().size());
  for (const v1::Point2& p : t.hull()) line.point(p);
  line.floats(t.support().b_m());
  line.floats(t.support().sigma_m());
  line.put(" %.9g %d %.9g %.9g '%s'", static_cast<double>(t.solidity()), t.truncated(),
           static_cast<double>(t.height_m()), static_cast<double>(t.height_sigma_m()), t.name().c_str());
  line.put(" %zu", t.points().size());
  for (const v1::ScenePoint& p : t.points()) {
    for (const float x : p.position_m()) line.put(" %.9g", static_cast<double>(x));
    line.put(" %.9g", static_cast<double>(p.sigma_m()));
  }
}

std::string lineOf(const v1::Objects& o) {
  Line line;
  line.put("objects %s", o.robot().c_str()).header(o.header());
  line.put(" %d %.17g", static_cast<int>(o.state()), o.camera_height_m());
  const v1::Motion& m = o.motion();
  line.put(" %d %" PRId64, m.valid(), static_cast<std::int64_t>(m.since_ns()));
  line.put(" %.17g %.17g %.17g", m.previous_from_current().x(), m.previous_from_current().y(),
           m.previous_from_current().theta());
  line.doubles(m.covariance());
  line.put(" %.17g %.17g %d", m.left_m(), m.right_m(), m.wheels_rejected());
  const v1::FloorMotion& f = o.floor_motion();
  line.put(" %d %" PRId64, f.valid(), static_cast<std::int64_t>(f.since_ns()));
  line.put(" %.17g %.17g %.17g", f.previous_from_current().x(), f.previous_from_current().y(),
           f.previous_from_current().theta());
  line.doubles(f.covariance());
  line.put(" %zu", o.tracks().size());
  for (const v1::Track& t : o.tracks()) put(line, t);
  line.point(o.scan().origin());
  line.put(" %.17g %zu", o.scan().blind_m(), o.scan().range_m().size());
  for (std::size_t i = 0; i < o.scan().range_m().size(); ++i) {
    line.put(" %.9g %.9g %u %u", static_cast<double>(o.scan().range_m()[i]),
             static_cast<double>(o.scan().sigma_m()[i]), o.scan().label()[i], o.scan().object()[i]);
  }
  return line.text();
}

std::string lineOf(const v1::Grid& g) {
  Line line;
  line.put("grid %s", g.map_name().c_str()).header(g.header());
  line.put(" %u %.17g", g.term(), g.resolution_m());
  line.point(g.origin());
  std::uint64_t hash = 1469598103934665603u;
  for (const std::uint8_t cell : g.cells()) hash = (hash ^ cell) * 1099511628211u;
  line.put(" %u %u %zu %" PRIu64, g.width(), g.height(), g.cells().size(), hash);
  return line.text();
}

TEST(Interop, CycloneReadsEveryFieldOfRunningFleet) {
  const std::string out = freshDir("cyclone");
  Listener listener(81);
  auto objects = listener.bus().reader(listener.topics().objects);
  auto poses = listener.bus().reader(listener.topics().pose);
  auto grids = listener.bus().reader(listener.topics().map_grid);
  Process cyclone({CYCLONE_SUBSCRIBER, "81", "60", "20", "20", "3"}, out + "/cyclone.txt",
                  {{"CYCLONEDDS_URI",
                    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name=\"lo\" "
                    "multicast=\"true\"/></Interfaces>"
                    "</General></Domain></CycloneDDS>"}});
  Process launch({program("launch"), "run", sourceDir() + "/config/fleets/small.yaml", "--realtime",
                  "--config", sourceDir() + "/tests/multiprocess/long.yaml", "--out", out, "--domain", "81"},
                 out + "/launch.log");
  std::set<std::string> own_lines;
  std::optional<int> code;
  const auto takeAll = [&] {
    v1::Objects o;
    while (objects->take(o)) own_lines.insert(lineOf(o));
    v1::Pose p;
    while (poses->take(p)) own_lines.insert(lineOf(p));
    v1::Grid g;
    while (grids->take(g)) own_lines.insert(lineOf(g));
  };
  listener.until(
      [&] {
        takeAll();
        code = cyclone.wait(0ms);
        return code.has_value();
      },
      60s);
  // The last samples that Cyclone took may arrive here a little later.
  listener.until(
      [&] {
        takeAll();
        std::istringstream lines(cyclone.output());
        for (std::string line; std::getline(lines, line);) {
          if (!own_lines.count(line)) return false;
        }
        return true;
      },
      5s);
  launch.signal(SIGTERM);
  launch.wait(5s);
  ASSERT_EQ(code, std::optional<int>(0)) << cyclone.output() << launch.output();
  std::map<std::string, int> equal;
  std::istringstream lines(cyclone.output());
  for (std::string line; std::getline(lines, line);) {
    const std::string topic = line.substr(0, line.find(' '));
    EXPECT_TRUE(own_lines.count(line)) << "differs: " << line.substr(0, 400);
    if (own_lines.count(line)) ++equal[topic];
  }
  EXPECT_GE(equal["objects"], 20);
  EXPECT_GE(equal["pose"], 20);
  EXPECT_GE(equal["grid"], 3);
}

}  // namespace
}  // namespace omnifleet::test
