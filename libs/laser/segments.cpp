#include "laser/segments.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::laser {
namespace {

/// True if beam `a` and its neighbour `b` hit one surface.
bool areConnected(const Beam& a, const Beam& b, double spacing_rad, double range_sigma_m,
                  const SegmentOptions& o) {
  if (a.echo != Echo::kHit || b.echo != Echo::kHit) return false;
  const double grazing = std::max(o.grazing_deg * M_PI / 180.0, 1.5 * spacing_rad);
  const double reach =
      std::min(a.range_m, b.range_m) * std::sin(spacing_rad) / std::sin(grazing - spacing_rad) +
      o.jump_sigmas * range_sigma_m;
  return (a.point_m - b.point_m).norm() <= reach;
}

/// True if the surface at `end` may continue, hidden, on the side of the neighbour.
bool isHidden(const Beam& end, const Beam* neighbour) {
  if (neighbour == nullptr || neighbour->echo == Echo::kBlind) return true;
  return neighbour->echo == Echo::kHit && neighbour->range_m < end.range_m;
}

}  // namespace

SegmentOptions SegmentOptions::read(const options::Section& section) {
  SegmentOptions o;
  section.read("grazing_deg", o.grazing_deg, {1.0, 80.0});
  section.read("jump_sigmas", o.jump_sigmas, {0.0, 100.0});
  section.finish();
  return o;
}

void segments(const Beams& beams, double range_sigma_m, const SegmentOptions& options,
              std::vector<Segment>& out) {
  out.clear();
  const std::size_t n = beams.size();
  const auto linked = [&](std::size_t i) {  // beam i with the previous one
    if (i % n == 0 && !beams.closed) return false;
    return areConnected(beams.at(i + n - 1), beams.at(i), beams.spacing_rad, range_sigma_m, options);
  };
  std::size_t start = 0;
  while (start < n && linked(start)) ++start;
  if (start == n) start = 0;  // one surface all around
  for (std::size_t i = start; i < start + n; ++i) {
    if (beams.at(i).echo != Echo::kHit) continue;
    if (out.empty() || i == start || !linked(i)) out.push_back({i, 0, false, false});
    ++out.back().count;
  }
  const auto neighbour = [&](std::size_t i, bool before) -> const Beam* {
    const bool seam = i % n == (before ? 0 : n - 1);
    return seam && !beams.closed ? nullptr : &beams.at(before ? i + n - 1 : i + 1);
  };
  for (Segment& s : out) {
    if (s.count == n) continue;  // a closed surface has no end
    const std::size_t last = s.first + s.count - 1;
    s.hidden_before = isHidden(beams.at(s.first), neighbour(s.first, true));
    s.hidden_after = isHidden(beams.at(last), neighbour(last, false));
  }
}

}  // namespace omnifleet::laser
