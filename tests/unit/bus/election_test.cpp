// One office, several candidates, a clock that the test moves. Candidates hear each other unless the network
// is split or one is dead.

#include "bus/election.h"

#include <gmock/gmock.h>

#include <map>
#include <memory>

namespace omnifleet::bus {
namespace {

using std::chrono::milliseconds;
using testing::ElementsAre;

class Candidates : public testing::Test {
 protected:
  explicit Candidates(std::size_t count = 3) : count_(count) {}

  void join(std::size_t rank) { elections_[rank] = std::make_unique<Election>(rank, count_, now_); }
  void joinAll() {
    for (std::size_t i = 0; i < count_; ++i) join(i);
  }
  void die(std::size_t rank) { elections_.erase(rank); }
  /// Ranks below `first_of_b` and the others no longer hear each other.
  void split(std::size_t first_of_b) { first_of_b_ = first_of_b; }
  void heal() { first_of_b_ = 0; }

  void pass(milliseconds time) {
    for (const auto end = now_ + time; now_ < end;) {
      now_ += milliseconds(10);
      std::map<std::size_t, Heard> said;
      for (const auto& [rank, election] : elections_) said[rank] = {election->term(), election->yielded()};
      for (const auto& [rank, election] : elections_) {
        for (std::size_t other = 0; other < count_; ++other) {
          const bool heard = said.count(other) > 0 && (rank < first_of_b_) == (other < first_of_b_);
          if (other != rank && heard) last_[{rank, other}] = said[other];
          const Heard& last = last_[{rank, other}];
          if (other != rank) election->hear(other, heard, last.term, last.yielded);
        }
        if (election->update(now_)) ++changes_;
      }
    }
  }
  std::vector<std::uint32_t> terms() const {
    std::vector<std::uint32_t> all;
    for (std::size_t i = 0; i < count_; ++i)
      all.push_back(elections_.count(i) > 0 ? elections_.at(i)->term() : 0);
    return all;
  }

  struct Heard {
    std::uint32_t term = 0, yielded = 0;
  };
  std::size_t count_;
  Election::Time now_{std::chrono::seconds(1000)};
  std::map<std::size_t, std::unique_ptr<Election>> elections_;
  std::map<std::pair<std::size_t, std::size_t>, Heard> last_;
  std::size_t first_of_b_ = 0;
  int changes_ = 0;
};

TEST_F(Candidates, FirstOneHoldsTheOfficeAtOnceIfAllAreHeard) {
  joinAll();
  pass(milliseconds(20));
  EXPECT_THAT(terms(), ElementsAre(1, 0, 0));
  pass(milliseconds(10000));
  EXPECT_EQ(changes_, 1);
}

TEST_F(Candidates, WaitsForTheOthersBeforeItTakesTheOffice) {
  join(1);
  pass(Election::kSettle - milliseconds(20));
  EXPECT_THAT(terms(), ElementsAre(0, 0, 0));
  pass(milliseconds(40));
  EXPECT_THAT(terms(), ElementsAre(0, 1, 0));
}

TEST_F(Candidates, NextOneTakesOverWithAGreaterTerm) {
  joinAll();
  pass(milliseconds(2000));
  die(0);
  pass(milliseconds(20));
  EXPECT_THAT(terms(), ElementsAre(0, 2, 0));
  die(1);
  pass(milliseconds(20));
  EXPECT_THAT(terms(), ElementsAre(0, 0, 3));
}

TEST_F(Candidates, OfficeDoesNotMoveBackWhenTheFirstOneReturns) {
  joinAll();
  pass(milliseconds(2000));
  die(0);
  pass(milliseconds(1000));
  join(0);
  pass(milliseconds(10000));
  EXPECT_THAT(terms(), ElementsAre(0, 2, 0));
  EXPECT_EQ(changes_, 2);
}

/// A process that was suspended still believes that it holds the office.
TEST_F(Candidates, SuspendedHolderGivesWay) {
  joinAll();
  pass(milliseconds(2000));
  auto suspended = std::move(elections_.at(0));
  die(0);
  pass(milliseconds(1000));
  elections_[0] = std::move(suspended);
  EXPECT_EQ(elections_[0]->term(), 1u);
  pass(milliseconds(20));
  EXPECT_EQ(elections_[0]->term(), 0u);
  pass(milliseconds(1000));
  EXPECT_THAT(terms(), testing::Contains(testing::Gt(1u)).Times(1)) << "exactly one holder";
}

/// Both parts of a split network have a holder. One remains, and it learns that it must take over the work of
/// the other one.
TEST_F(Candidates, OneHolderRemainsWhenANetworkHeals) {
  joinAll();
  pass(milliseconds(2000));
  split(1);
  pass(milliseconds(1000));
  EXPECT_THAT(terms(), ElementsAre(1, 2, 0));
  changes_ = 0;
  heal();
  pass(milliseconds(1000));
  EXPECT_THAT(terms(), ElementsAre(0, 3, 0)) << "the greater term remains, and grows";
  EXPECT_EQ(changes_, 2) << "also if the other one gave way before it was heard";
  pass(milliseconds(10000));
  EXPECT_EQ(changes_, 2);
}

TEST_F(Candidates, CandidateThatDoesNotTakeItsTurnIsPassedOver) {
  joinAll();
  pass(milliseconds(2000));
  die(0);
  // Candidate 1 is heard but hangs: it never decides.
  auto hanging = std::move(elections_.at(1));
  elections_.erase(1);
  Election& last = *elections_.at(2);
  for (int i = 0; i < 100 && last.term() == 0; ++i) {
    now_ += milliseconds(10);
    last.hear(0, false, 1, 0);
    last.hear(1, true, 0, 0);
    last.update(now_);
  }
  EXPECT_EQ(last.term(), 2u);
}

/// The first one fails before it takes the office. The third one hears nothing of the second one's term.
TEST_F(Candidates, TurnsBeginAgainWhenAnEarlierCandidateFails) {
  Election second(1, 3, now_), third(2, 3, now_);
  for (int i = 0; i < 45; ++i) {
    now_ += milliseconds(10);
    second.hear(0, i < 20, 0, 0);
    second.hear(2, true, 0, 0);
    third.hear(0, i < 20, 0, 0);
    third.hear(1, true, 0, 0);
    second.update(now_);
    third.update(now_);
    EXPECT_EQ(third.term(), 0u) << i;
  }
  EXPECT_EQ(second.term(), 1u);
}

/// Also one that has heard all others only while the office was held.
TEST_F(Candidates, HolderThatDiesAtOnceIsFollowedByTheNextOne) {
  joinAll();
  pass(milliseconds(20));
  die(0);
  pass(milliseconds(20));
  EXPECT_THAT(terms(), ElementsAre(0, 2, 0));
}

/// At the end of a run the holder ends first; the others must not begin the work again.
TEST_F(Candidates, NobodyTakesTheOfficeOfFinishedWork) {
  joinAll();
  pass(milliseconds(2000));
  elections_.at(1)->finish();
  elections_.at(2)->finish();
  die(0);
  pass(milliseconds(10000));
  EXPECT_THAT(terms(), ElementsAre(0, 0, 0));
}

/// The poses of a dead localizer have its term; those of the next one must outrank them.
TEST_F(Candidates, TermsThatWereUsedAreNotUsedAgain) {
  join(2);
  elections_.at(2)->noteTerm(7);
  pass(milliseconds(2000));
  EXPECT_THAT(terms(), ElementsAre(0, 0, 8));
}

}  // namespace
}  // namespace omnifleet::bus
