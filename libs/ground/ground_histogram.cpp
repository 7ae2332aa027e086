#include "ground/ground_histogram.h"

#include <algorithm>
#include <numeric>

namespace omnifleet::ground {

namespace {

/// Calls visit(bin) for a bin and its 26 neighbours.
template <typename Visit>
void aroundBin(int bin, Visit visit) {
  const int b = bin >> 10, g = bin >> 5 & 31, r = bin & 31;
  for (int bb = std::max(b - 1, 0); bb <= std::min(b + 1, 31); ++bb)
    for (int gg = std::max(g - 1, 0); gg <= std::min(g + 1, 31); ++gg)
      for (int rr = std::max(r - 1, 0); rr <= std::min(r + 1, 31); ++rr) visit(bb << 10 | gg << 5 | rr);
}

}  // namespace

void GroundHistogram::clear() {
  for (const int bin : used_) count_[static_cast<std::size_t>(bin)] = 0;
  used_.clear();
}

void GroundHistogram::spread(const std::vector<int>& from, int min_count, std::vector<int>& reached) {
  for (const int bin : from) {
    aroundBin(bin, [&](int near) {
      auto& mark = is_ground_[static_cast<std::size_t>(near)];
      if (mark != 0 || count_[static_cast<std::size_t>(near)] < min_count) return;
      mark = 1;
      reached.push_back(near);
    });
  }
}

double GroundHistogram::settle(double min_share, int grow, bool all_modes) {
  std::fill(is_ground_.begin(), is_ground_.end(), std::uint8_t{0});
  const auto countOf = [&](int bin) { return count_[static_cast<std::size_t>(bin)]; };
  const auto total =
      std::accumulate(used_.begin(), used_.end(), 0L, [&](long n, int bin) { return n + countOf(bin); });
  if (total == 0) return 0.0;
  const int min_count = std::max(1, static_cast<int>(min_share * static_cast<double>(total)));
  std::vector<int> best;
  long best_count = 0;
  std::sort(used_.begin(), used_.end());
  for (const int start : used_) {
    if (countOf(start) < min_count || is_ground_[static_cast<std::size_t>(start)] != 0) continue;
    ground_.assign(1, start);
    is_ground_[static_cast<std::size_t>(start)] = 1;
    for (std::size_t next = 0; next < ground_.size(); ++next) {
      front_.assign(1, ground_[next]);
      spread(front_, min_count, ground_);
    }
    const long count =
        std::accumulate(ground_.begin(), ground_.end(), 0L, [&](long n, int b) { return n + countOf(b); });
    if (all_modes) {
      best.insert(best.end(), ground_.begin(), ground_.end());
      best_count += count;
    } else if (count > best_count) {
      best = ground_;
      best_count = count;
    }
  }
  std::fill(is_ground_.begin(), is_ground_.end(), std::uint8_t{0});
  for (const int bin : best) is_ground_[static_cast<std::size_t>(bin)] = 1;
  front_ = best;
  for (int step = 0; step < grow; ++step) {
    ground_.clear();
    spread(front_, 0, ground_);
    front_ = ground_;
  }
  return static_cast<double>(best_count) / static_cast<double>(total);
}

}  // namespace omnifleet::ground
