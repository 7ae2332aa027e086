#!/usr/bin/env bash
# Drives robots through a simulated scene: installs, builds, runs, saves the map, evaluates it against the truth.
# usage: scripts/demo.sh [choi|room|ahmed|explore|fernandez] [--out DIR] [--realtime]
#        choi (default): three robots in formation among free-standing obstacles; room: three robots in a furnished room;
#        ahmed: two robots with forward cameras and two parked ones under two ceiling cameras, in a divided arena;
#        explore: the same robots explore that arena by themselves until nothing reachable is unknown;
#        fernandez: 200 images along a loop of one robot, recorded with the independent renderer (tests/raycast); topological
#        maps with wheels, by the images alone, and as printed in Fernández et al. 2011
. "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"

scene=demo out=
realtime=()
while [ $# -gt 0 ]; do
  case "$1" in
    choi) scene=demo; shift ;;
    room|ahmed|explore|fernandez) scene="$1"; shift ;;
    --out)
      out="${2-}"
      [ -n "$out" ] || { say "demo.sh: --out needs a directory"; exit 2; }
      shift 2 ;;
    --realtime) realtime=(--realtime); shift ;;
    -h|--help) sed -n '2,8p' "$0" | cut -c3-; exit 0 ;;
    *) say "demo.sh: unknown option $1"; exit 2 ;;
  esac
done
if [ "$scene" = fernandez ] && [ "${#realtime[@]}" -gt 0 ]; then
  say "demo.sh: fernandez replays a recording; --realtime does not apply"
  exit 2
fi
out="${out:-$root/out/$scene}"

# Value of robot r1 in metrics.json.
metric() { awk -v key="\"$1\":" '$1 == key { sub(/,$/, "", $2); print $2; exit }' "$2/metrics.json"; }

# Set 1 of Fernández et al. 2011: images 10 cm apart in an office-like room. The independent renderer draws doors, radiators
# and curtains; the arenas of omnifleet's own simulation have none.
fernandez() {
  local name
  cmake --build "$build" --target raycast_room >&2
  mkdir -p "$out"
  if [ ! -e "$out/recording" ]; then
    say "recording 200 images"
    rm -rf "$out/unfinished"
    "$build/tests/raycast_room" "$out/unfinished" 7 --set 1 --fast --vga >&2
    mv "$out/unfinished" "$out/recording"
  fi
  printf 'services: {local_mapper: {wheels: {use: false}}}\n' >"$out/images_alone.yaml"
  for name in omnifleet images_alone literal; do
    say "run: $name"
    rm -rf "${out:?}/$name"
    case "$name" in
      omnifleet) set -- ;;
      images_alone) set -- --config "$out/images_alone.yaml" ;;
      literal) set -- --config "$root/config/papers/fernandez.yaml" ;;
    esac
    "$bin/omnifleet_launch" replay "$out/recording" --out "$out/$name" "$@"
    "$bin/omnifleet_evaluate" "$out/$name" "$out/recording" >"$out/$name/evaluation.txt"
  done
  printf '%-14s %18s %18s %8s\n' "" "shape difference" "shape difference" ""
  printf '%-14s %18s %18s %8s\n' run "of the places" "of the path" places
  for name in omnifleet images_alone literal; do
    printf '%-14s %18.6f %18.6f %8d\n' "$name" "$(metric places_shape_difference "$out/$name")" \
      "$(metric shape_difference "$out/$name")" "$(metric places "$out/$name")"
  done
  say "topological maps: $out/{omnifleet,images_alone,literal}/places/r1.png, map: $out/omnifleet/map.png"
}

# The pictures of the ceiling cameras need the images of the run.
record=()
[ "$scene" != ahmed ] || record=(--record)

"$root/scripts/setup.sh"
if [ "$scene" = fernandez ]; then
  fernandez
  exit
fi
"$bin/omnifleet_launch" run "$root/config/fleets/$scene.yaml" --out "$out" "${record[@]}" "${realtime[@]}"
"$bin/omnifleet_evaluate" "$out" "$out/recording"
[ "$scene" != ahmed ] || "$bin/omnifleet_ceiling_view" "$out" "$out/recording"
say "map: $out/map.png"
