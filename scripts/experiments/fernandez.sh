#!/usr/bin/env bash
# Repeats the study of Fernández et al. 2011, §V, in furnished rooms of the independent renderer (tests/raycast), new rooms
# for every seed. Set 1: 200 images 10 cm apart with a loop. Set 2: 150 images, taken when the difference from the image
# before exceeds a threshold, out of 600. Sweeps k1, k2 and the step over both with the topological map as printed and
# with that of omnifleet, without and with wheels. Replays both sets: as printed (config/papers/fernandez.yaml), without
# wheels, and as they are. Prints the rows of a seed as it finishes, then the table paper / literal / omnifleet / odometry,
# and draws Figs. 4-11 of the first seed. Finished steps are not repeated: after Ctrl-C the same command continues.
# Remove OUT/seed_*/set*/{literal,no_wheels,omnifleet,study.json} to run again on the same recordings.
# usage: scripts/experiments/fernandez.sh [--seeds A-B] [--out DIR] [--quick] [--jobs N]
#        defaults: --seeds 1000-1009, --out out/fernandez_experiment, --jobs 1 (each seed uses all cores); --quick: only the
#        first seed. OMNIFLEET_SKIP_BUILD=1 uses the programs as they are.
. "$(dirname "$0")/../common.sh"

out="$root/out/fernandez_experiment" first=1000 last=1009 quick=0 jobs=1
while [ $# -gt 0 ]; do
  case "$1" in
    --seeds)
      [[ "${2:-}" =~ ^([0-9]+)-([0-9]+)$ ]] || { say "fernandez.sh: --seeds needs two numbers, A-B"; exit 2; }
      first="${BASH_REMATCH[1]}" last="${BASH_REMATCH[2]}"; shift 2 ;;
    --out) out="${2:?--out needs a directory}"; shift 2 ;;
    --jobs) jobs="${2:?--jobs needs a number}"; shift 2 ;;
    --quick) quick=1; shift ;;
    -h|--help) sed -n '2,11p' "$0" | cut -c3-; exit 0 ;;
    *) say "fernandez.sh: unknown option $1"; exit 2 ;;
  esac
done
[ "$quick" = 0 ] || last="$first"
[ "$first" -le "$last" ] || { say "fernandez.sh: --seeds $first-$last is empty"; exit 2; }
[[ "$jobs" =~ ^[1-9][0-9]?$ && "$jobs" -le 40 ]] || { say "fernandez.sh: --jobs needs a number from 1 to 40"; exit 2; }

room="$build/tests/raycast_room" experiment="$build/tests/omnifleet_fernandez_experiment"
if [ "${OMNIFLEET_SKIP_BUILD:-0}" = 0 ]; then
  "$root/scripts/setup.sh" >&2
  cmake --build "$build" --target raycast_room omnifleet_fernandez_experiment -j "$(nproc)" >&2
fi
need_build
for program in "$room" "$experiment"; do
  [ -x "$program" ] || { say "fernandez.sh: $program is not built"; exit 1; }
done
mkdir -p "$out"
out="$(cd "$out" && pwd)"
no_wheels="$out/no_wheels.yaml"
printf 'services: {local_mapper: {wheels: {use: false}}}\n' >"$no_wheels"

# Both sets of one seed. The body of a background process; ends its program when it is stopped.
run_seed() {
  local seed="$1" domain="$2" folder="$out/seed_$1" child="" code
  trap '' INT  # Ctrl-C reaches the main process, which sends SIGTERM
  trap 'trap "" TERM; [ -z "$child" ] || { kill "$child" || true; wait "$child" || true; } 2>/dev/null; exit 143' TERM
  try() {
    code=0
    "$@" >>"$folder/log" 2>&1 &
    child=$!
    wait "$child" || code=$?
    child=""
    return "$code"
  }
  step() { try "$@" || { say "$1 returned $code" 2>>"$folder/log"; exit "$code"; }; }
  record() {  # record SET
    local at="$folder/set$1" room_seed
    [ ! -e "$at/recording" ] || return 0
    rm -rf "$at"
    mkdir -p "$at"
    # In some rooms the way around the furniture is longer than the path of the images: then the room of another seed.
    for room_seed in "$seed" $((seed + 10)) $((seed + 20)) $((seed + 30)) $((seed + 40)); do
      ! try "$room" "$at/unfinished" "$room_seed" --set "$1" --fast || break
      rm -rf "$at/unfinished"
    done
    [ -e "$at/unfinished" ] || exit 1
    printf '%s\n' "$room_seed" >"$at/room_seed"
    if [ "$1" = 2 ]; then
      step "$experiment" pick --recording "$at/unfinished" --out "$at/picked"
      rm -rf "$at/unfinished"
      mv "$at/picked" "$at/unfinished"
    fi
    mv "$at/unfinished" "$at/recording"
  }
  replay() {  # replay FOLDER NAME OPTION…
    local at="$1/$2"
    [ ! -e "$at/metrics.json" ] || return 0
    rm -rf "$at"
    OMNIFLEET_DOMAIN="$domain" step "$root/scripts/replay.sh" "$1/recording" --out "$at" "${@:3}"
    step "$root/scripts/evaluate.sh" "$at" "$1/recording"
  }
  mkdir -p "$folder"
  local set at timed=()
  # Times are measured once: they hardly depend on the seed. Other seeds would disturb them.
  [ "$seed" != "$first" ] || timed=(--timed)
  for set in 1 2; do
    at="$folder/set$set"
    record "$set"
    [ -e "$at/study.json" ] || step "$experiment" study --recording "$at/recording" --out "$at/study.json" "${timed[@]}"
    replay "$at" literal --config "$root/config/papers/fernandez.yaml"
    replay "$at" no_wheels --config "$no_wheels"
    replay "$at" omnifleet
  done
}

declare -A seed_of=() slot_of=() busy=()
stop() {
  trap '' INT TERM
  [ "${#seed_of[@]}" = 0 ] || kill "${!seed_of[@]}" 2>/dev/null || true
  wait
  say "fernandez.sh: stopped; the same command continues from here"
  exit 130
}
trap stop INT TERM

total=$((last - first + 1)) finished=0 failed=0 began=$SECONDS base="${OMNIFLEET_DOMAIN:-100}"
start() {
  local slot=0
  while [ -n "${busy[$slot]:-}" ]; do slot=$((slot + 1)); done
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
    "$experiment" rows --seed "$seed" --out "$out"
  else
    failed=$((failed + 1))
    say "seed $seed failed: $out/seed_$seed/log"
    tail -n 3 "$out/seed_$seed/log" >&2 || true
  fi
  local left=$(((SECONDS - began) * (total - finished) / finished))
  say "$finished of $total, $((left / 60)) min $((left % 60)) s left"
}

say "$total seeds, $jobs in parallel, output in $out"
"$experiment" heading
for ((seed = first; seed <= last; ++seed)); do
  [ "${#seed_of[@]}" -lt "$jobs" ] || finish_one
  start "$seed"
done
while [ "${#seed_of[@]}" -gt 0 ]; do finish_one; done
trap - INT TERM

[ "$failed" -lt "$total" ] || { say "fernandez.sh: all seeds failed"; exit 1; }
"$experiment" report --out "$out" --first "$first" --last "$last"
"$experiment" figures --out "$out" --first "$first" --last "$last"
say "table: $out/table.txt, figures: $out/figures"
[ "$failed" = 0 ] || { say "fernandez.sh: $failed of $total seeds failed"; exit 1; }
