#pragma once

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace omnifleet::bus {

/// Who of a fleet has stopped to tell its status: a process that hangs says nothing of it itself. Has no
/// clock: the caller says when.
class Silence {
 public:
  using Clock = std::chrono::steady_clock;
  struct Limits {
    std::chrono::seconds after_a_word{3};       ///< three times the period of service/status
    std::chrono::seconds before_the_first{15};  ///< of what is expected: many start at once on a busy machine
  };
  struct Silent {
    std::string who;
    std::chrono::seconds lasts{0};
    bool heard = false;  ///< false: never yet
  };

  explicit Silence(Limits limits) : limits_(limits) {}

  /// It is to speak, though it may never have.
  void expect(const std::string& who, Clock::time_point now);
  /// It spoke; who has `finished` may be silent.
  void heard(const std::string& who, bool finished, Clock::time_point now);
  /// All that are silent now, sorted. To be asked a few times a second: in a longer pause the caller itself
  /// was held up, and could not hear; that time counts for nobody.
  std::vector<Silent> silent(Clock::time_point now);

 private:
  struct Voice {
    Clock::time_point last;  ///< word, or since when it is expected
    bool heard = false, finished = false;
  };
  Limits limits_;
  std::map<std::string, Voice> voices_;
  std::optional<Clock::time_point> looked_;
};

/// "silent for 4 s", "not heard in 15 s".
std::string toString(const Silence::Silent& silent);

}  // namespace omnifleet::bus
