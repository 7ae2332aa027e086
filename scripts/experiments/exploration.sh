#!/usr/bin/env bash
# Two robots with rendered forward cameras explore arenas of blocks, a new arena for every seed (even seeds: the walls of
# config/arenas/ahmed.yaml and ahmed2.yaml in turn, odd seeds: walls of the seed). All stages run in one process. Prints one
# row per seed: share of the reachable floor that the merged map shows, by the truth; collisions; time until the robots
# report that all is explored. Returns 1 if a seed did not end by itself, touched something, or mapped less than 98 %.
# usage: scripts/experiments/exploration.sh [--seeds A-B] [--out DIR]
#        defaults: --seeds 1000-1019, --out out/exploration. OUT/seed_N/fleet.yaml is the fleet of seed N,
#        OUT/seed_N/run its map, OUT/seed_N/run/missing.png the reachable floor that is unknown (red).
#        OMNIFLEET_SKIP_BUILD=1 uses the programs as they are.
. "$(dirname "$0")/../common.sh"

out="$root/out/exploration" first=1000 last=1019
while [ $# -gt 0 ]; do
  case "$1" in
    --seeds)
      [[ "${2:-}" =~ ^([0-9]+)-([0-9]+)$ ]] || { say "exploration.sh: --seeds needs two numbers, A-B"; exit 2; }
      first="${BASH_REMATCH[1]}" last="${BASH_REMATCH[2]}"; shift 2 ;;
    --out) out="${2:?--out needs a directory}"; shift 2 ;;
    -h|--help) sed -n '2,9p' "$0" | cut -c3-; exit 0 ;;
    *) say "exploration.sh: unknown option $1"; exit 2 ;;
  esac
done
[ "$first" -le "$last" ] || { say "exploration.sh: --seeds $first-$last is empty"; exit 2; }

experiment="$build/tests/omnifleet_exploration_experiment"
if [ "${OMNIFLEET_SKIP_BUILD:-0}" = 0 ]; then
  "$root/scripts/setup.sh" >&2
  cmake --build "$build" --target omnifleet_exploration_experiment -j "$(nproc)" >&2
fi
[ -x "$experiment" ] || { say "exploration.sh: $experiment is not built"; exit 1; }
exec "$experiment" --first "$first" --last "$last" --arenas "$root/config/arenas" --out "$out"
