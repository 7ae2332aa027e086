// Shows the status of every service of a running fleet: a table that is updated, or printed once.

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>

#include "bus/dds_bus.h"
#include "bus/network.h"
#include "bus/topics.h"
#include "options/options.h"
#include "options/range_check.h"
#include "status/table.h"

namespace {

using omnifleet::status::Table;
using Clock = Table::Clock;

constexpr int kServiceSilent = 3;  // the code of a service that ends because another one is silent

/// Readers of the status topics.
struct StatusReaders {
  explicit StatusReaders(omnifleet::bus::Bus& bus)
      : statuses(bus.reader(omnifleet::bus::Topics(omnifleet::bus::RunMode::kLive).service_status)),
        states(
            bus.reader(bestEffort(omnifleet::bus::Topics(omnifleet::bus::RunMode::kLive).formation_state))) {}

  void takeAll(Table& table) {
    omnifleet::v1::ServiceStatus status;
    while (statuses->take(status)) table.put(status, Clock::now());
    omnifleet::v1::FormationState state;
    while (states->take(state)) table.put(state);
  }

  /// The writer of a keep-all stream waits for its reliable readers. Best effort ensures that a suspended
  /// status table cannot block a run.
  template <class T>
  static omnifleet::bus::Topic<T> bestEffort(omnifleet::bus::Topic<T> topic) {
    topic.qos.reliable = false;
    return topic;
  }

  std::unique_ptr<omnifleet::bus::Reader<omnifleet::v1::ServiceStatus>> statuses;
  std::unique_ptr<omnifleet::bus::Reader<omnifleet::v1::FormationState>> states;
};

int show(int domain, const omnifleet::bus::NetworkRequest& network, bool once, double wait_s) {
  omnifleet::bus::DdsBusOptions options;
  options.name = "omnifleet_status";
  options.domain = domain;
  omnifleet::bus::resolve(network).apply(options);
  const auto bus = omnifleet::bus::makeDdsBus(options);
  StatusReaders readers(*bus);
  const bool terminal = isatty(STDOUT_FILENO) == 1;
  const auto end =
      Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(wait_s));
  Table table;
  auto shown = Clock::now();
  while (!once || Clock::now() < end) {
    bus->wait(std::chrono::milliseconds(200));
    readers.takeAll(table);
    table.update(Clock::now());
    if (once || Clock::now() - shown < std::chrono::seconds(1)) continue;
    shown = Clock::now();
    std::printf("%s%s%s", terminal ? "\033[H\033[J" : "", table.text().c_str(), terminal ? "" : "\n");
    std::fflush(stdout);
  }
  if (table.size() == 0) {
    std::fprintf(
        stderr,
        "no fleet found on DDS domain %d; check --domain, --interface (a fleet on several machines) and "
        "that the fleet runs\n",
        domain);
    return 1;
  }
  std::fputs(table.text().c_str(), stdout);
  return table.anySilent() ? kServiceSilent : 0;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Shows the status of every service of a running fleet"};
  int domain = 0;
  omnifleet::bus::NetworkRequest network;
  bool once = false;
  double wait_s = 2.5;
  app.add_option("--domain", domain, "DDS domain")
      ->check(omnifleet::options::domainNumber())
      ->envname("OMNIFLEET_DOMAIN");
  omnifleet::bus::addNetworkOptions(app, network);
  app.add_flag("--once", once,
               "print one table and exit; exit code 1: no fleet found, 3: a service is silent");
  app.add_option("--wait", wait_s, "with --once: seconds to listen")
      ->check(omnifleet::options::within({0.1, 3600.0}));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    return show(domain, network, once, wait_s);
  } catch (const omnifleet::options::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "status: %s\n", error.what());
    return 1;
  }
}
