// Sends a formation command to a running fleet: behaviour, shape, distance, angle, waypoints.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <map>

#include "bus/dds_bus.h"
#include "bus/service.h"
#include "command/command_sender.h"
#include "common/fleet_network.h"
#include "options/range_check.h"

namespace {

using omnifleet::options::within;
using omnifleet::services::CommandRequest;

struct CommandLine {
  std::string fleet;
  std::vector<std::string> overlays;
  int domain = 0;
  omnifleet::bus::NetworkRequest network;
  double wait_s = 5.0;
  CommandRequest request;
};

Eigen::Vector2d pointOf(const std::string& text) {
  Eigen::Vector2d point;
  int used = 0;
  const bool two = std::sscanf(text.c_str(), "%lf,%lf%n", &point.x(), &point.y(), &used) == 2;
  if (!two || used != static_cast<int>(text.size()) || !point.allFinite())
    throw CLI::ValidationError("--waypoints", "'" + text + "' is not X,Y in metres");
  constexpr double kFarthest_m = 1000.0;
  if (point.cwiseAbs().maxCoeff() > kFarthest_m)
    throw CLI::ValidationError("--waypoints",
                               "'" + text + "' is beyond 1000 m; X and Y are metres in the map frame");
  return point;
}

void parse(CLI::App& app, int argc, char** argv, CommandLine& line) {
  using omnifleet::motion::FormationShape;
  const std::map<std::string, FormationShape> shapes{{"line", FormationShape::kLine},
                                                     {"column", FormationShape::kColumn},
                                                     {"wedge", FormationShape::kWedge},
                                                     {"triangle", FormationShape::kTriangle}};
  std::string shape, behaviour;
  double distance_m = 0.0, angle_rad = 0.0, boundary_m = 0.0;
  std::vector<std::string> waypoints;
  app.add_option("fleet", line.fleet, "fleet file of the running fleet")
      ->required()
      ->check(omnifleet::options::notEmpty());
  app.add_option("--config", line.overlays,
                 "YAML on top of the fleet file, the same as at the start of the fleet");
  auto* with_shape = app.add_option("--shape", shape, "line, column, wedge or triangle")
                         ->check(CLI::IsMember({"line", "column", "wedge", "triangle"}));
  auto* with_distance = app.add_option("--distance", distance_m, "d, distance to the robot ahead, metres")
                            ->check(within({0.1, 20.0}));
  auto* with_angle =
      app.add_option("--angle", angle_rad, "θ, angle between the robot ahead and the own heading, radians")
          ->check(within({0.0, 3.2}));
  const std::vector<std::string>& behaviours = omnifleet::motion::behaviourNames();
  auto* with_behaviour =
      app.add_option("--behaviour", behaviour, "formation, boundary_following or exploration")
          ->check(CLI::IsMember(behaviours));
  auto* with_boundary = app.add_option("--boundary", boundary_m,
                                       "boundary following: distance of base_link to the boundary, metres")
                            ->check(within({0.05, 5.0}));
  auto* with_way =
      app.add_option("--waypoints", waypoints, "X,Y … in the map frame, metres; the last one is the goal")
          ->expected(1, 64);
  auto* with_halt =
      app.add_flag("--halt", line.request.halt, "stop until the next command")->excludes(with_way);
  app.add_option("--wait", line.wait_s, "seconds to wait until every robot follows the command")
      ->check(within({0.1, 3600.0}));
  app.add_option("--domain", line.domain, "DDS domain")
      ->check(omnifleet::options::domainNumber())
      ->envname("OMNIFLEET_DOMAIN");
  omnifleet::bus::addNetworkOptions(app, line.network);
  app.parse(argc, argv);
  if (with_shape->count() + with_distance->count() + with_angle->count() + with_way->count() +
          with_halt->count() + with_behaviour->count() + with_boundary->count() ==
      0)
    throw CLI::ValidationError(
        "no command", "give --behaviour, --boundary, --shape, --distance, --angle, --waypoints or --halt");
  if (with_shape->count() > 0) line.request.shape = shapes.at(shape);
  if (with_distance->count() > 0) line.request.distance_m = distance_m;
  if (with_angle->count() > 0) line.request.angle_rad = angle_rad;
  if (with_boundary->count() > 0) line.request.boundary_m = boundary_m;
  if (with_behaviour->count() > 0) {
    const auto found = std::find(behaviours.begin(), behaviours.end(), behaviour);
    line.request.behaviour = static_cast<omnifleet::motion::Behaviour>(found - behaviours.begin());
  }
  for (const std::string& waypoint : waypoints) line.request.waypoints_m.push_back(pointOf(waypoint));
}

int send(const CommandLine& line) {
  using namespace omnifleet;
  const fleet::Fleet fleet = fleet::Fleet::load(line.fleet, {}, line.overlays);
  if (!fleet.hasFormation()) throw options::Error(line.fleet + ": this fleet has no formation");
  bus::DdsBusOptions options;
  options.name = "omnifleet_command";
  options.domain = line.domain;
  services::networkOf(fleet, line.network).apply(options);
  const auto bus = bus::makeDdsBus(options);
  services::CommandSender sender(*bus, bus::Topics(bus::RunMode::kLive), fleet);
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  const bool followed = sender.send(line.request, std::chrono::nanoseconds(now).count(),
                                    std::chrono::milliseconds(static_cast<int>(1e3 * line.wait_s)));
  const auto& sent = sender.sent();
  if (followed) {
    const std::string halted = sent.halt ? ", halted" : "";
    if (sent.behaviour == motion::Behaviour::kFormation) {
      std::printf("%s: %s, d %.2f m, angle %.2f rad%s\n", fleet.name.c_str(), motion::toString(sent.shape),
                  sent.distance_m, sent.angle_rad, halted.c_str());
    } else if (sent.behaviour == motion::Behaviour::kBoundaryFollowing) {
      std::printf("%s: boundary following at %.2f m%s\n", fleet.name.c_str(), sent.boundary_m,
                  halted.c_str());
    } else {
      std::printf("%s: exploration%s\n", fleet.name.c_str(), halted.c_str());
    }
    return static_cast<int>(bus::ExitCode::kOk);
  }
  for (const std::string& robot : sender.missing())
    std::fprintf(stderr,
                 "the formation of %s did not confirm the command; check its status (scripts/status.sh)\n",
                 robot.c_str());
  return static_cast<int>(bus::ExitCode::kFailure);
}

}  // namespace

int main(int argc, char** argv) {
  using omnifleet::bus::ExitCode;
  CLI::App app{"Sends a formation command to a running fleet; values that are not given stay unchanged"};
  CommandLine line;
  try {
    parse(app, argc, argv, line);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : static_cast<int>(ExitCode::kBadOptions);
  }
  try {
    return send(line);
  } catch (const omnifleet::options::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return static_cast<int>(ExitCode::kBadOptions);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "omnifleet_command: %s\n", error.what());
    return static_cast<int>(ExitCode::kFailure);
  }
}
