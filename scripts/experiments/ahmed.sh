#!/usr/bin/env bash
# Repeats the experiments of Ahmed et al. 2013 in arenas of the independent renderer (tests/raycast), a new arena for every
# seed, layouts 1 and 2 in turn: two robots with forward cameras map, two are parked, two ceiling cameras locate all four.
# Compares what the paper reports, its method as printed (config/papers/ahmed.yaml with a scale fitted as in Table 1) and
# omnifleet. Prints the rows of a seed as it finishes, then the table, and draws the figures. The first seeds of both layouts
# are also recorded with old ceiling images, moving and with stop-and-wait, for the cost of a stale heading. Finished runs
# are not repeated: after Ctrl-C the same command continues. Remove OUT/seed_*/literal and omnifleet to run again.
# usage: scripts/experiments/ahmed.sh [--seeds A-B] [--out DIR] [--quick] [--jobs N]
#        defaults: --seeds 1000-1009, --out out/ahmed_experiment, --jobs 1 (each seed uses all cores); --quick: only the
#        first two seeds, 25 s each. OMNIFLEET_SKIP_BUILD=1 uses the programs as they are.
. "$(dirname "$0")/../common.sh"

out="$root/out/ahmed_experiment" first=1000 last=1009 frames=250 jobs=1
while [ $# -gt 0 ]; do
  case "$1" in
    --seeds)
      [[ "${2:-}" =~ ^([0-9]+)-([0-9]+)$ ]] || { say "ahmed.sh: --seeds needs two numbers, A-B"; exit 2; }
      first="${BASH_REMATCH[1]}" last="${BASH_REMATCH[2]}"; shift 2 ;;
    --out) out="${2:?--out needs a directory}"; shift 2 ;;
    --jobs) jobs="${2:?--jobs needs a number}"; shift 2 ;;
    --quick) frames=125; shift ;;
    -h|--help) sed -n '2,10p' "$0" | cut -c3-; exit 0 ;;
    *) say "ahmed.sh: unknown option $1"; exit 2 ;;
  esac
done
[ "$frames" = 250 ] || last=$((last < first + 1 ? last : first + 1))
[ "$first" -le "$last" ] || { say "ahmed.sh: --seeds $first-$last is empty"; exit 2; }
[[ "$jobs" =~ ^[1-9][0-9]?$ && "$jobs" -le 40 ]] || { say "ahmed.sh: --jobs needs a number from 1 to 40"; exit 2; }

arena="$build/tests/raycast_arena" experiment="$build/tests/omnifleet_ahmed_experiment"
if [ "${OMNIFLEET_SKIP_BUILD:-0}" = 0 ]; then
  "$root/scripts/setup.sh" >&2
  cmake --build "$build" --target raycast_arena omnifleet_ahmed_experiment -j "$(nproc)" >&2
fi
need_build
for program in "$arena" "$experiment"; do
  [ -x "$program" ] || { say "ahmed.sh: $program is not built"; exit 1; }
done
mkdir -p "$out/figures"
out="$(cd "$out" && pwd)"

cells="$out/cells.yaml" scale="$out/scale"
printf 'services: {global_merger: {occupancy: {resolution_m: 0.02}}}\n' >"$cells"
literal=(--config "$root/config/papers/ahmed.yaml" --config "$scale/overlay.yaml")

# Table 1: pairs of distances, the fit of eq. 1, Fig. 3b.
fit_the_scale() {
  mkdir -p "$scale"
  [ -e "$scale/pairs.csv" ] || "$experiment" scale --seed "$first" --out "$scale" >"$scale/metres_per_ceiling_px"
  "$bin/omnifleet_fit_scale" "$scale/pairs.csv" --out "$scale/scale.yaml" --overlay "$scale/overlay.yaml" \
    --metres-per-ceiling-px "$(cat "$scale/metres_per_ceiling_px")" --plot "$out/figures/fig3_scale.png" >"$scale/table.txt"
}

# One recording with its two runs. The body of a background process; ends its program when it is stopped.
run_seed() {
  local seed="$1" domain="$2" folder="$out/seed_$1" child="" code
  trap '' INT  # Ctrl-C reaches the main process, which sends SIGTERM
  trap 'trap "" TERM; [ -z "$child" ] || { kill "$child" || true; wait "$child" || true; } 2>/dev/null; exit 143' TERM
  mkdir -p "$folder"
  step() {
    code=0
    "$@" >>"$folder/log" 2>&1 &
    child=$!
    wait "$child" || code=$?
    child=""
    [ "$code" = 0 ] || { say "$1 returned $code" 2>>"$folder/log"; exit "$code"; }
  }
  record() {  # record FOLDER OPTION…
    local at="$1" arguments="--seed $seed --layout $((1 + seed % 2)) --frames $frames${2:+ }${*:2}"
    if [ ! -e "$at/recording" ] || [ "$arguments" != "$(cat "$at/recording.arguments" 2>/dev/null)" ]; then
      rm -rf "$at/recording" "$at/unfinished" "$at/literal" "$at/omnifleet"
      mkdir -p "$at"
      # shellcheck disable=SC2086  # words
      step "$arena" "$at/unfinished" $arguments
      printf '%s\n' "$arguments" >"$at/recording.arguments"
      mv "$at/unfinished" "$at/recording"
    fi
  }
  replay() {  # replay FOLDER METHOD OPTION…
    local at="$1/$2"
    [ ! -e "$at/metrics.json" ] || return 0
    rm -rf "$at"
    OMNIFLEET_DOMAIN="$domain" step "$root/scripts/replay.sh" "$1/recording" --out "$at" --config "$cells" "${@:3}"
    step "$root/scripts/evaluate.sh" "$at" "$1/recording"
  }
  both() {
    replay "$1" literal "${literal[@]}"
    replay "$1" omnifleet
  }
  record "$folder"
  both "$folder"
  if [ "$seed" -lt $((first + 2)) ]; then
    step "$root/scripts/ceiling_view.sh" "$folder/omnifleet" "$folder/recording"
    record "$folder/stale" --stale 0.2
    both "$folder/stale"
    record "$folder/waiting" --stale 0.2 --stop-and-wait 0.8
    both "$folder/waiting"
  fi
}

declare -A seed_of=() slot_of=() busy=()
stop() {
  trap '' INT TERM
  [ "${#seed_of[@]}" = 0 ] || kill "${!seed_of[@]}" 2>/dev/null || true
  wait
  say "ahmed.sh: stopped; the same command continues from here"
  exit 130
}
trap stop INT TERM

total=$((last - first + 1)) finished=0 failed=0 began=$SECONDS base="${OMNIFLEET_DOMAIN:-60}"
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

fit_the_scale
cat "$scale/table.txt"
say "$total seeds, $jobs in parallel, output in $out"
"$experiment" heading
for ((seed = first; seed <= last; ++seed)); do
  [ "${#seed_of[@]}" -lt "$jobs" ] || finish_one
  start "$seed"
done
while [ "${#seed_of[@]}" -gt 0 ]; do finish_one; done
trap - INT TERM

[ "$failed" -lt "$total" ] || { say "ahmed.sh: all seeds failed"; exit 1; }
"$experiment" report --out "$out" --first "$first" --last "$last"
"$experiment" figures --out "$out" --first "$first" --last "$last" "${literal[@]}"
say "table: $out/table.txt, figures: $out/figures"
[ "$failed" = 0 ] || { say "ahmed.sh: $failed of $total seeds failed"; exit 1; }
