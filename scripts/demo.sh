#!/usr/bin/env bash
# Drives three robots through a simulated scene: installs, builds, runs, saves the map, evaluates it against the truth.
# usage: scripts/demo.sh [room] [--out DIR] [--realtime]
#        without a name: an arena with free-standing obstacles, in formation; room: a furnished room
. "$(dirname "$0")/common.sh"

scene=demo out=
realtime=()
while [ $# -gt 0 ]; do
  case "$1" in
    room) scene=room; shift ;;
    --out) out="${2:?--out needs a directory}"; shift 2 ;;
    --realtime) realtime=(--realtime); shift ;;
    -h|--help) sed -n '2,4p' "$0" | cut -c3-; exit 0 ;;
    *) say "demo.sh: unknown option $1"; exit 2 ;;
  esac
done
out="${out:-$root/out/$scene}"

"$root/scripts/setup.sh"
"$bin/omnifleet_launch" run "$root/config/fleets/$scene.yaml" --out "$out" "${realtime[@]}"
"$bin/omnifleet_evaluate" "$out" "$out/recording"
say "map: $out/map.png"
