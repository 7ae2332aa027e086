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
. "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/seeds.sh"

out="$root/out/ahmed_experiment" first=1000 last=1009 jobs=1 quick_seeds=2 default_domain=60
read_options '--seeds|--out|--quick|--jobs' "$@"
frames=$((quick ? 125 : 250))
build_programs raycast_arena omnifleet_ahmed_experiment
need_build
experiment="$build/tests/omnifleet_ahmed_experiment"
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

# record_and_replay AT OPTION…: a recording with its two runs.
record_and_replay() {
  local arguments="--seed $seed --layout $((1 + seed % 2)) --frames $frames${2:+ }${*:2}"
  # shellcheck disable=SC2086  # words
  record "$1" "$arguments" "$build/tests/raycast_arena" "$1/unfinished" $arguments
  replay "$1/recording" "$1/literal" --config "$cells" "${literal[@]}"
  replay "$1/recording" "$1/omnifleet" --config "$cells"
}

run_seed() {
  record_and_replay "$folder"
  if [ "$seed" -lt $((first + 2)) ]; then
    step "$root/scripts/ceiling_view.sh" "$folder/omnifleet" "$folder/recording"
    record_and_replay "$folder/stale" --stale 0.2
    record_and_replay "$folder/waiting" --stale 0.2 --stop-and-wait 0.8
  fi
}

heading() { "$experiment" heading; }
show_seed() { "$experiment" rows --seed "$1" --out "$out"; }

fit_the_scale
cat "$scale/table.txt"
run_seeds
[ "$failed" -lt "$total" ] || { say "$script: all seeds failed"; exit 1; }
"$experiment" report --out "$out" --first "$first" --last "$last"
"$experiment" figures --out "$out" --first "$first" --last "$last" "${literal[@]}"
say "table: $out/table.txt, figures: $out/figures"
check_failures
