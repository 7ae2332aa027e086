#include "bus/election.h"

#include <algorithm>

namespace omnifleet::bus {

Election::Election(std::size_t rank, std::size_t candidates, Time start)
    : rank_(rank), others_(candidates), settled_(start + kSettle) {}

void Election::hear(std::size_t rank, bool alive, std::uint32_t term, std::uint32_t yielded) {
  others_.at(rank) = {alive, term, yielded};
  noteTerm(term);
}

void Election::noteTerm(std::uint32_t term) {
  greatest_ = std::max(greatest_, term);
}

/// Another living holder that this one must give way to.
bool Election::holdsAbove(std::size_t rank) const {
  const Other& other = others_[rank];
  return other.alive && (other.term > term_ || (other.term == term_ && rank < rank_));
}

bool Election::update(Time now) {
  wake_at_.reset();
  if (finished_) return false;
  bool any_holder = false, all_alive = true;
  std::uint32_t above = 0;
  for (std::size_t i = 0; i < others_.size(); ++i) {
    if (i == rank_) continue;
    all_alive = all_alive && others_[i].alive;
    if (!others_[i].alive || others_[i].term == 0) continue;
    any_holder = true;
    if (holdsAbove(i)) above = std::max(above, others_[i].term);
  }
  // Whoever holds the office is known now.
  if (all_alive || any_holder) settled_ = std::min(settled_, now);
  if (term_ == 0) {
    if (!any_holder) return take(now);
    vacant_since_.reset();
    return false;
  }
  if (above > 0) {
    yielded_ = above;
    term_ = 0;
    return true;
  }
  const bool has_outlasted = std::any_of(others_.begin(), others_.end(), [this](const Other& other) {
    return other.alive && other.yielded == term_;
  });
  if (has_outlasted) term_ = ++greatest_;
  return has_outlasted;
}

/// The office is vacant. The candidates before this one have their turn first.
bool Election::take(Time now) {
  if (now < settled_) {
    wake_at_ = settled_;
    return false;
  }
  int before = 0;
  for (std::size_t i = 0; i < rank_; ++i) before += others_[i].alive ? 1 : 0;
  // A candidate that fails while it could have taken the office does not shorten the turns of the others.
  if (!vacant_since_ || before < before_) vacant_since_ = now;
  before_ = before;
  const Time turn = *vacant_since_ + before * kTurn;
  if (now < turn) {
    wake_at_ = turn;
    return false;
  }
  vacant_since_.reset();
  term_ = ++greatest_;
  return true;
}

}  // namespace omnifleet::bus
