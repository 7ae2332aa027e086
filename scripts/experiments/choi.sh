#!/usr/bin/env bash
# Repeats the experiments of Choi et al. 2014, V.1 (static) and V.2 (dynamic), with a new room for every seed. Compares
# the numbers of the paper, its method as printed (config/papers/choi.yaml) and omnifleet. Prints the tables and draws the
# figures of the first seed. Finished seeds are not repeated: after Ctrl-C the same command continues.
# usage: scripts/experiments/choi.sh [--seeds A-B] [--out DIR] [--quick] [--jobs N]
#        defaults: --seeds 1000-1019, --out out/choi, --jobs one per core; --quick: only the first three seeds.
#        OMNIFLEET_SKIP_BUILD=1 uses the programs as they are.
. "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/seeds.sh"

out="$root/out/choi" first=1000 last=1019 jobs="$(nproc)" quick_seeds=3 most_jobs=9999
read_options '--seeds|--out|--quick|--jobs' "$@"
build_programs omnifleet_choi_experiment
experiment="$build/tests/omnifleet_choi_experiment"
mkdir -p "$out"

run_seed() {
  local figures=()
  [ "$seed" != "$first" ] || figures=(--figures)
  step "$experiment" seed "$seed" --config "$root/config" --out "$out" "${figures[@]}"
}

heading() { :; }

# shellcheck disable=SC2034  # the progress line ends with note
show_seed() {
  note="$(tail -n 1 "$out/seed_$1/log")"
  rm -rf "$out/seed_$1"
}

# After a failed seed no more seeds start.
show_failure() {
  say "seed $1 failed: $out/seed_$1/log"
  stop_code="$2" next=$((last + 1))
}

stop_code=0
run_seeds
[ "$stop_code" = 0 ] || exit "$stop_code"
"$experiment" report --out "$out" --first "$first" --last "$last"
say "figures: $out/figures, $out/robots.png"
