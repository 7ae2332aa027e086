#!/usr/bin/env bash
# Measures omnifleet in furnished rooms of the independent renderer (tests/raycast), one new room per seed. The variant
# follows from the seed: one robot, three robots, images by distance, a dim room, two rooms joined by a door. Prints one
# row per seed as it finishes, then the medians and the worst values; writes them to OUT/table.txt. Finished seeds are
# not repeated: after Ctrl-C the same command continues. Remove OUT/seed_*/run to measure again on the same recordings.
# usage: scripts/experiments/rooms.sh [--seeds A-B] [--out DIR] [--quick] [--jobs N] [--width PIXELS]
#        defaults: --seeds 1000-1019, --out out/rooms, --jobs 1 (each seed uses all cores), --width 640; --quick: only
#        the first three seeds. OMNIFLEET_SKIP_BUILD=1 uses the programs as they are.
. "$(dirname "$0")/../common.sh"

out="$root/out/rooms" first=1000 last=1019 quick=0 jobs=1 width=640
while [ $# -gt 0 ]; do
  case "$1" in
    --seeds)
      [[ "${2:-}" =~ ^([0-9]+)-([0-9]+)$ ]] || { say "rooms.sh: --seeds needs two numbers, A-B"; exit 2; }
      first="${BASH_REMATCH[1]}" last="${BASH_REMATCH[2]}"; shift 2 ;;
    --out) out="${2:?--out needs a directory}"; shift 2 ;;
    --jobs) jobs="${2:?--jobs needs a number}"; shift 2 ;;
    --width) width="${2:?--width needs a number of pixels}"; shift 2 ;;
    --quick) quick=1; shift ;;
    -h|--help) sed -n '2,8p' "$0" | cut -c3-; exit 0 ;;
    *) say "rooms.sh: unknown option $1"; exit 2 ;;
  esac
done
[ "$quick" = 0 ] || last=$((last < first + 2 ? last : first + 2))
[ "$first" -le "$last" ] || { say "rooms.sh: --seeds $first-$last is empty"; exit 2; }
[[ "$jobs" =~ ^[1-9][0-9]?$ && "$jobs" -le 40 ]] || { say "rooms.sh: --jobs needs a number from 1 to 40"; exit 2; }
[[ "$width" =~ ^[1-9][0-9]*$ ]] || { say "rooms.sh: --width needs a positive number"; exit 2; }

if [ "${OMNIFLEET_SKIP_BUILD:-0}" = 0 ]; then
  "$root/scripts/setup.sh" >&2
  cmake --build "$build" --target raycast_room -j "$(nproc)" >&2
fi
need_build
room="$build/tests/raycast_room"
[ -x "$room" ] || { say "rooms.sh: $room is not built"; exit 1; }
mkdir -p "$out"

variants=("one robot" "three robots" "by distance" "dim" "two rooms")
options=("--robots 1 --frames 200" "--robots 3 --frames 200" "--by-distance --frames 191" "--dim --frames 200"
  "--rooms 2 --frames 200")

# Prints the row of a seed from the metrics: one number per line with its path, as JSON is indented by two.
row_of() {
  awk -v seed="$1" -v variant="$2" '
    match($0, /^ +"[^"]+": /) {
      depth = (index($0, "\"") - 1) / 2
      key[depth] = substr($0, 2 * depth + 2, RLENGTH - 2 * depth - 4)
      value = substr($0, RLENGTH + 1)
      sub(/,$/, "", value)
      path = key[1]
      for (k = 2; k <= depth; ++k) path = path "/" key[k]
      v[path] = value
      if (depth == 3 && key[1] == "paths" && key[3] == "frames") { frames += value; ++robots }
    }
    function number(path, factor, decimals) {
      return path in v && v[path] != "null" ? sprintf("%." decimals "f", factor * v[path]) : "-"
    }
    END {
      matched = v["map/matched"]
      printf "%d\t%s\t%d\t%d\t%s\t%s\t%s\t%s\t%s\t%d\t%d\t%d\t%s\t%s\t%s\t%s\t%s\n", seed, variant, robots, frames,
        (frames > 0 ? sprintf("%.1f", 100 * v["paths_mean/poses"] / frames) : "-"),
        number("paths_mean/distance_m", 100, 2), number("paths_mean/max_m", 100, 2),
        number("paths_mean/heading_rad", 57.29578, 3), number("paths_mean/consistency/nees_mean", 1, 2),
        matched, v["map/truths"] - matched, v["map/estimates"] - matched,
        number("cells/all/within_2cm", 100, 1), number("cells/all/seen_occupied", 100, 1),
        number("cells/occupied_per_crossed", 1, 2), number("cells/free_wrong", 100, 2),
        (robots > 1 ? number("kinds/robot/f1", 1, 3) : "-")
    }' "$3"
}

layout() {
  awk -F '\t' '{ printf "%6s  %-12s %6s %6s %9s %7s %7s %9s %7s %6s %6s %6s %7s %7s %7s %7s %7s\n", $1, $2, $3,
                 $4, $5, $6, $7, $8, $9, $10, $11, $12, $13, $14, $15, $16, $17 }'
}

heading() {
  printf 'seed\tvariant\trobots\tframes\tlocalized\tmean\tmax\theading\tNEES\tfound\tmissed\tfalse\tcells\tfaces\tthick\twrong\tF1\n' | layout
  printf '\t\t\t\t%%\tcm\tcm\tdeg\t\t\t\t\t%%\t%%\t\t%%\t\n' | layout
}

# Medians and worst values of the columns from "localized" on. Small is worse for "localized", "found",
# "cells" (within 2 cm of a true face), "faces" (seen within 1.8 m, occupied) and "F1".
summary() {
  awk -F '\t' '
    { for (c = 5; c <= 17; ++c) if ($c != "-") sample[c, ++count[c]] = $c }
    END {
      for (c = 5; c <= 17; ++c) {
        n = count[c]
        for (i = 2; i <= n; ++i)
          for (j = i; j > 1 && sample[c, j - 1] + 0 > sample[c, j] + 0; --j) {
            swap = sample[c, j]; sample[c, j] = sample[c, j - 1]; sample[c, j - 1] = swap
          }
        middle = n % 2 ? sample[c, (n + 1) / 2] : (sample[c, n / 2] + sample[c, n / 2 + 1]) / 2
        median = median "\t" (n == 0 ? "-" : sprintf("%." (c == 8 || c == 17 ? 3 : (c > 5 && c < 10) || c == 15 || c == 16 ? 2 : 1) "f", middle))
        worst = worst "\t" (n == 0 ? "-" : c == 5 || c == 10 || c == 13 || c == 14 || c == 17 ? sample[c, 1] : sample[c, n])
      }
      print "\tmedian\t\t" median
      print "\tworst\t\t" worst
    }'
}

# One seed: recording, run, evaluation, row. The body of a background process; ends its program when it is stopped.
run_seed() {
  local seed="$1" domain="$2" folder="$out/seed_$1" child="" code
  trap '' INT  # Ctrl-C reaches the main process, which sends SIGTERM
  trap 'trap "" TERM; [ -z "$child" ] || { kill "$child" || true; wait "$child" || true; } 2>/dev/null; exit 143' TERM
  step() {
    code=0
    "$@" >>"$folder/log" 2>&1 &
    child=$!
    wait "$child" || code=$?
    child=""
    [ "$code" = 0 ] || { say "$1 returned $code" 2>>"$folder/log"; exit "$code"; }
  }
  mkdir -p "$folder"
  local arguments="${options[$((seed % 5))]} --width $width"
  if [ ! -e "$folder/recording" ] || [ "$arguments" != "$(cat "$folder/recording.arguments" 2>/dev/null)" ]; then
    rm -rf "$folder/recording" "$folder/unfinished" "$folder/run"
    # shellcheck disable=SC2086  # words
    step "$room" "$folder/unfinished" "$seed" $arguments
    printf '%s\n' "$arguments" >"$folder/recording.arguments"
    mv "$folder/unfinished" "$folder/recording"
  fi
  if [ ! -e "$folder/run/metrics.json" ]; then
    rm -rf "$folder/run"
    OMNIFLEET_DOMAIN="$domain" step "$root/scripts/replay.sh" "$folder/recording" --out "$folder/run"
    step "$root/scripts/evaluate.sh" "$folder/run" "$folder/recording"
  fi
  row_of "$seed" "${variants[$((seed % 5))]}" "$folder/run/metrics.json" >"$folder/row.part" 2>>"$folder/log"
  mv "$folder/row.part" "$folder/row"
}

declare -A seed_of=() slot_of=() busy=()
stop() {
  trap '' INT TERM
  [ "${#seed_of[@]}" = 0 ] || kill "${!seed_of[@]}" 2>/dev/null || true
  wait
  say "rooms.sh: stopped; the same command continues from here"
  exit 130
}
trap stop INT TERM

total=$((last - first + 1)) finished=0 failed=0 began=$SECONDS base="${OMNIFLEET_DOMAIN:-30}"
start() {
  local slot=0
  while [ -n "${busy[$slot]:-}" ]; do slot=$((slot + 1)); done
  rm -f "$out/seed_$1/row"
  run_seed "$1" $((base + slot)) &
  seed_of[$!]="$1" slot_of[$!]="$slot" busy[$slot]=1
}
finish_one() {
  local pid code=0
  wait -n -p pid || code=$?
  local seed="${seed_of[$pid]}"
  unset "busy[${slot_of[$pid]}]" "seed_of[$pid]" "slot_of[$pid]"
  finished=$((finished + 1))
  if [ "$code" = 0 ]; then
    layout <"$out/seed_$seed/row"
  else
    failed=$((failed + 1))
    printf '%s\t%s\tfailed: %s\n' "$seed" "${variants[$((seed % 5))]}" "$out/seed_$seed/log" | layout
    tail -n 3 "$out/seed_$seed/log" >&2 || true
  fi
  local left=$(((SECONDS - began) * (total - finished) / finished))
  say "$finished of $total, $((left / 60)) min $((left % 60)) s left"
}

say "$total seeds, $jobs in parallel, output in $out"
heading
for ((seed = first; seed <= last; ++seed)); do
  [ "${#seed_of[@]}" -lt "$jobs" ] || finish_one
  start "$seed"
done
while [ "${#seed_of[@]}" -gt 0 ]; do finish_one; done
trap - INT TERM

rows=()
for ((seed = first; seed <= last; ++seed)); do
  [ ! -e "$out/seed_$seed/row" ] || rows+=("$out/seed_$seed/row")
done
if [ "${#rows[@]}" -gt 0 ]; then
  cat "${rows[@]}" | summary | layout
  { heading; cat "${rows[@]}" | layout; cat "${rows[@]}" | summary | layout; } >"$out/table.txt"
fi
say "table: $out/table.txt"
[ "$failed" = 0 ] || { say "rooms.sh: $failed of $total seeds failed"; exit 1; }
