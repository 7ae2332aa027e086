#!/usr/bin/env bash
# Drives three robots in formation through a simulated arena: installs, builds, runs, saves the map, evaluates it against the truth.
# usage: scripts/demo.sh [--out DIR] [--realtime]
. "$(dirname "$0")/common.sh"

out="$root/out/demo"
realtime=()
while [ $# -gt 0 ]; do
  case "$1" in
    --out) out="${2:?--out needs a directory}"; shift 2 ;;
    --realtime) realtime=(--realtime); shift ;;
    -h|--help) sed -n '2,3p' "$0" | cut -c3-; exit 0 ;;
    *) say "demo.sh: unknown option $1"; exit 2 ;;
  esac
done

"$root/scripts/setup.sh"
"$bin/omnifleet_launch" run "$root/config/fleets/demo.yaml" --out "$out" "${realtime[@]}"
"$bin/omnifleet_evaluate" "$out" "$out/recording"
say "map: $out/map.png"
