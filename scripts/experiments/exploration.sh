#!/usr/bin/env bash
# Two robots with rendered forward cameras explore arenas of blocks, a new arena for every seed (even seeds: the walls of
# config/arenas/ahmed.yaml and ahmed2.yaml in turn, odd seeds: walls of the seed). All stages run in one process. Prints one
# row per seed: share of the reachable floor that the merged map shows, by the truth; collisions; time until the robots
# report that all is explored. Returns 1 if a seed did not end by itself, touched something, or mapped less than 98 %.
# usage: scripts/experiments/exploration.sh [--seeds A-B] [--out DIR]
#        defaults: --seeds 1000-1019, --out out/exploration. OUT/seed_N/fleet.yaml is the fleet of seed N,
#        OUT/seed_N/run its map, OUT/seed_N/run/missing.png the reachable floor that is unknown (red).
#        OMNIFLEET_SKIP_BUILD=1 uses the programs as they are.
. "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/seeds.sh"

out="$root/out/exploration" first=1000 last=1019
read_options '--seeds|--out' "$@"
build_programs omnifleet_exploration_experiment
exec "$build/tests/omnifleet_exploration_experiment" --first "$first" --last "$last" --arenas "$root/config/arenas" --out "$out"
