// Candidates of one office on a bus, with their heartbeats.

#include "common/office.h"

#include <gmock/gmock.h>

#include "bus/fake_bus.h"

namespace omnifleet::services {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

bus::FakeBusOptions liveBus() {
  bus::FakeBusOptions options;
  options.mode = bus::RunMode::kLive;
  return options;
}

/// A process with its candidacy.
struct Candidate {
  Candidate(std::shared_ptr<bus::FakeNetwork> network, const std::string& name)
      : bus(bus::makeFakeBus(network, liveBus())),
        office({*bus, {}, bus::Topics(bus::RunMode::kLive), nullptr}, "map", {"r1", "r2", "r3"}, name,
               steady_clock::now()) {}
  std::unique_ptr<bus::Bus> bus;
  Office office;
};

class Offices : public testing::Test {
 protected:
  Candidate& join(const std::string& name) {
    return *(candidates_[name] = std::make_unique<Candidate>(network_, name));
  }
  /// Updates all candidates until `done`. @return how long it took
  template <class Done>
  milliseconds until(Done done) {
    const auto begun = steady_clock::now();
    while (!done() && steady_clock::now() - begun < std::chrono::seconds(10)) {
      for (const auto& [name, candidate] : candidates_) {
        candidate->office.update(steady_clock::now());
        candidate->bus->wait(milliseconds(5));
      }
    }
    return std::chrono::duration_cast<milliseconds>(steady_clock::now() - begun);
  }
  std::uint32_t term(const std::string& name) const { return candidates_.at(name)->office.term(); }

  std::shared_ptr<bus::FakeNetwork> network_ = bus::makeFakeNetwork();
  std::map<std::string, std::unique_ptr<Candidate>> candidates_;
};

TEST_F(Offices, AreTakenOverSoonAfterTheDeathOfTheirHolder) {
  for (const char* name : {"r1", "r2", "r3"}) join(name);
  until([&] { return term("r1") > 0; });
  EXPECT_EQ(term("r1"), 1u);
  candidates_.erase("r1");
  EXPECT_LT(until([&] { return term("r2") > 0; }), milliseconds(2000)) << "without load 0.5 s";
  EXPECT_EQ(term("r2"), 2u);
  EXPECT_EQ(term("r3"), 0u);
}

/// The main loop of a service may compute for a second.
TEST_F(Offices, AreKeptByAHolderThatComputes) {
  for (const char* name : {"r1", "r2"}) join(name);
  until([&] { return term("r1") > 0; });
  const auto begun = steady_clock::now();
  while (steady_clock::now() - begun < 4 * Office::kLease) {
    candidates_.at("r2")->office.update(steady_clock::now());
    candidates_.at("r2")->bus->wait(milliseconds(5));
  }
  EXPECT_EQ(term("r2"), 0u);
}

TEST_F(Offices, AreTakenOverFromAHolderThatHangs) {
  for (const char* name : {"r1", "r2"}) join(name);
  until([&] { return term("r1") > 0; });
  const auto begun = steady_clock::now();
  while (term("r2") == 0 && steady_clock::now() - begun < Office::kHang + std::chrono::seconds(5)) {
    candidates_.at("r2")->office.update(steady_clock::now());
    candidates_.at("r2")->bus->wait(milliseconds(5));
  }
  EXPECT_EQ(term("r2"), 2u);
  EXPECT_GE(steady_clock::now() - begun, Office::kHang - milliseconds(200));
  until([&] { return term("r1") == 0; });
  EXPECT_EQ(term("r1"), 0u) << "when it goes on, it gives way";
}

TEST_F(Offices, OfFinishedWorkStayVacant) {
  for (const char* name : {"r1", "r2"}) join(name);
  until([&] { return term("r1") > 0; });
  candidates_.at("r1")->office.leave(true);
  candidates_.erase("r1");
  const auto begun = steady_clock::now();
  until([&] { return term("r2") > 0 || steady_clock::now() - begun > 3 * Office::kLease; });
  EXPECT_EQ(term("r2"), 0u);
}

TEST_F(Offices, PassOnAtOnceWhenTheHolderIsStopped) {
  for (const char* name : {"r1", "r2"}) join(name);
  until([&] { return term("r1") > 0; });
  candidates_.at("r1")->office.leave(false);
  candidates_.erase("r1");
  until([&] { return term("r2") > 0; });
  EXPECT_EQ(term("r2"), 2u);
}

}  // namespace
}  // namespace omnifleet::services
