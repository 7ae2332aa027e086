#!/usr/bin/env bash
# Repeats the study of Fernández et al. 2011, §V, in furnished rooms of the independent renderer (tests/raycast), new rooms
# for every seed. Set 1: 200 images 10 cm apart with a loop. Set 2: 150 images, taken when the difference from the image
# before exceeds a threshold, out of 600. Sweeps k1, k2 and the step over both with the topological map as printed and
# with that of omnifleet, without and with wheels. Replays both sets: as printed (config/papers/fernandez.yaml), without
# wheels, and as they are. Prints the rows of a seed as it finishes, then the table paper / literal / omnifleet / odometry,
# and draws Figs. 4-11 of the first seed. One more figure, compass_over_distance.png (.csv: its numbers), shows the error of
# the visual compass and the difference of the signatures over the true distance of two images (§III.B: under 0.8 m).
# Finished steps are not repeated: after Ctrl-C the same command continues.
# Remove OUT/seed_*/set*/{literal,no_wheels,omnifleet,study.json} to run again on the same recordings.
# usage: scripts/experiments/fernandez.sh [--seeds A-B] [--out DIR] [--quick] [--jobs N]
#        defaults: --seeds 1000-1009, --out out/fernandez_experiment, --jobs 1 (each seed uses all cores); --quick: only the
#        first seed. OMNIFLEET_SKIP_BUILD=1 uses the programs as they are.
. "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/seeds.sh"

out="$root/out/fernandez_experiment" first=1000 last=1009 jobs=1 quick_seeds=1 default_domain=100
read_options '--seeds|--out|--quick|--jobs' "$@"
build_programs raycast_room omnifleet_fernandez_experiment
need_build
experiment="$build/tests/omnifleet_fernandez_experiment"
mkdir -p "$out"
out="$(cd "$out" && pwd)"
no_wheels="$out/no_wheels.yaml"
printf 'services: {local_mapper: {wheels: {use: false}}}\n' >"$no_wheels"

# record_set SET: in some rooms the way around the furniture is longer than the path of the images. Then the room of another
# seed is recorded.
record_set() {
  local at="$folder/set$1" room_seed
  [ ! -e "$at/recording" ] || return 0
  rm -rf "$at"
  mkdir -p "$at"
  for room_seed in "$seed" $((seed + 10)) $((seed + 20)) $((seed + 30)) $((seed + 40)); do
    ! attempt "$build/tests/raycast_room" "$at/unfinished" "$room_seed" --set "$1" --fast || break
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

run_seed() {
  local set at timed=()
  # Times are measured once: they hardly depend on the seed. Other seeds would disturb them.
  [ "$seed" != "$first" ] || timed=(--timed)
  for set in 1 2; do
    at="$folder/set$set"
    record_set "$set"
    [ -e "$at/study.json" ] || step "$experiment" study --recording "$at/recording" --out "$at/study.json" "${timed[@]}"
    replay "$at/recording" "$at/literal" --config "$root/config/papers/fernandez.yaml"
    replay "$at/recording" "$at/no_wheels" --config "$no_wheels"
    replay "$at/recording" "$at/omnifleet"
  done
}

heading() { "$experiment" heading; }
show_seed() { "$experiment" rows --seed "$1" --out "$out"; }

run_seeds
[ "$failed" -lt "$total" ] || { say "$script: all seeds failed"; exit 1; }
"$experiment" report --out "$out" --first "$first" --last "$last"
"$experiment" figures --out "$out" --first "$first" --last "$last"
say "table: $out/table.txt, figures: $out/figures"
check_failures
