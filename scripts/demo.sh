#!/usr/bin/env bash
# Drives robots through a simulated scene: installs, builds, runs, saves the map, evaluates it against the truth.
# usage: scripts/demo.sh [choi|room|ahmed|explore] [--out DIR] [--realtime]
#        choi (default): three robots in formation among free-standing obstacles; room: three robots in a furnished room;
#        ahmed: two robots with forward cameras and two parked ones under two ceiling cameras, in a divided arena;
#        explore: the same robots explore that arena by themselves until nothing reachable is unknown
. "$(dirname "$0")/common.sh"

scene=demo out=
realtime=()
while [ $# -gt 0 ]; do
  case "$1" in
    choi) scene=demo; shift ;;
    room|ahmed|explore) scene="$1"; shift ;;
    --out) out="${2:?--out needs a directory}"; shift 2 ;;
    --realtime) realtime=(--realtime); shift ;;
    -h|--help) sed -n '2,6p' "$0" | cut -c3-; exit 0 ;;
    *) say "demo.sh: unknown option $1"; exit 2 ;;
  esac
done
out="${out:-$root/out/$scene}"
# The pictures of the ceiling cameras need the images of the run.
record=()
[ "$scene" != ahmed ] || record=(--record)

"$root/scripts/setup.sh"
"$bin/omnifleet_launch" run "$root/config/fleets/$scene.yaml" --out "$out" "${record[@]}" "${realtime[@]}"
"$bin/omnifleet_evaluate" "$out" "$out/recording"
[ "$scene" != ahmed ] || "$bin/omnifleet_ceiling_view" "$out" "$out/recording"
say "map: $out/map.png"
