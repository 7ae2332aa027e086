#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace omnifleet::bus {

/// Which of several candidates holds an office, by liveliness and term. Each candidate decides for itself
/// from what it hears of the others. At most one of the candidates that hear each other holds the office
/// after a moment; of two holders that meet (the network was split) the one with the greater term remains. A
/// candidate that returns stands by while another one holds the office, so the office does not move back.
/// Has no clock and no threads of its own.
class Election {
 public:
  using Time = std::chrono::steady_clock::time_point;

  /// @param rank of this candidate, 0 ... candidates − 1: of several that could take the office the first one
  /// does @param start no office is taken before all others are heard, or kSettle has passed: an office that
  /// is held must be heard first
  Election(std::size_t rank, std::size_t candidates, Time start);

  /// What is known of another candidate: whether it is alive, its latest term (0: stands by), and the term of
  /// the holder to which it gave way (0: none).
  void hear(std::size_t rank, bool alive, std::uint32_t term, std::uint32_t yielded);
  /// Terms up to this one have been used, by whomever.
  void noteTerm(std::uint32_t term);
  /// The work is done: the office stays vacant.
  void finish() { finished_ = true; }
  /// Decides. Returns true when term() has changed. A holder whose term grows has outlasted another holder
  /// and must take over its work.
  bool update(Time now);

  /// > 0: this candidate holds the office. 0: it stands by.
  std::uint32_t term() const { return term_; }
  /// > 0: this candidate held the office and gave way to a holder with this term.
  std::uint32_t yielded() const { return yielded_; }
  /// When update() is due again without anything heard; empty: not at all.
  std::optional<Time> wakeAt() const { return wake_at_; }

  static constexpr std::chrono::milliseconds kSettle{1500};  ///< twice the discovery of a busy machine
  static constexpr std::chrono::milliseconds kTurn{300};     ///< between the turns of two candidates

 private:
  struct Other {
    bool alive = false;
    std::uint32_t term = 0, yielded = 0;
  };
  bool holdsAbove(std::size_t rank) const;
  bool take(Time now);

  std::size_t rank_;
  std::vector<Other> others_;  ///< by rank; the own entry is not used
  Time settled_;
  std::uint32_t term_ = 0, greatest_ = 0, yielded_ = 0;
  bool finished_ = false;
  std::optional<Time> vacant_since_, wake_at_;
  int before_ = 0;  ///< living candidates that have their turn first, at the last take()
};

}  // namespace omnifleet::bus
