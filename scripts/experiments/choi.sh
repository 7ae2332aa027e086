#!/usr/bin/env bash
# Repeats the experiments of Choi et al. 2014, V.1 (static) and V.2 (dynamic), with a new room for every seed. Compares
# the numbers of the paper, its method as printed (config/papers/choi.yaml) and omnifleet. Prints the tables and draws the
# figures of the first seed. Finished seeds are not repeated: after Ctrl-C the same command continues.
# usage: scripts/experiments/choi.sh [--seeds A-B] [--out DIR] [--quick] [--jobs N]
#        defaults: --seeds 1000-1019, --out out/choi, --jobs one per core; --quick: only the first three seeds
. "$(dirname "$0")/../common.sh"

out="$root/out/choi" first=1000 last=1019 quick=0 jobs="$(nproc)"
while [ $# -gt 0 ]; do
  case "$1" in
    --seeds)
      [[ "${2:-}" =~ ^([0-9]+)-([0-9]+)$ ]] || { say "choi.sh: --seeds needs two numbers, A-B"; exit 2; }
      first="${BASH_REMATCH[1]}" last="${BASH_REMATCH[2]}"; shift 2 ;;
    --out) out="${2:?--out needs a directory}"; shift 2 ;;
    --jobs) jobs="${2:?--jobs needs a number}"; shift 2 ;;
    --quick) quick=1; shift ;;
    -h|--help) sed -n '2,6p' "$0" | cut -c3-; exit 0 ;;
    *) say "choi.sh: unknown option $1"; exit 2 ;;
  esac
done
[ "$quick" = 0 ] || last=$((last < first + 2 ? last : first + 2))
[ "$first" -le "$last" ] || { say "choi.sh: --seeds $first-$last is empty"; exit 2; }
[[ "$jobs" =~ ^[1-9][0-9]*$ ]] || { say "choi.sh: --jobs needs a positive number"; exit 2; }

"$root/scripts/setup.sh" >&2
cmake --build "$build" --target omnifleet_choi_experiment -j "$jobs" >&2
experiment="$build/tests/omnifleet_choi_experiment"
mkdir -p "$out"

declare -A seed_of=()
stop() {
  trap '' INT TERM
  [ "${#seed_of[@]}" = 0 ] || kill "${!seed_of[@]}" 2>/dev/null || true
  wait
  say "choi.sh: stopped; the same command continues from here"
  exit 130
}
trap stop INT TERM

total=$((last - first + 1)) finished=0 began=$SECONDS
start() {
  local figures=()
  [ "$1" != "$first" ] || figures=(--figures)
  "$experiment" seed "$1" --config "$root/config" --out "$out" "${figures[@]}" >"$out/seed_$1.log" 2>&1 &
  seed_of[$!]="$1"
}
finish_one() {
  local pid code=0
  wait -n -p pid || code=$?
  local seed="${seed_of[$pid]}"
  unset "seed_of[$pid]"
  finished=$((finished + 1))
  if [ "$code" != 0 ]; then
    say "seed $seed failed:"
    cat "$out/seed_$seed.log" >&2
    stop_code="$code"
    return
  fi
  local left=$(((SECONDS - began) * (total - finished) / finished))
  say "$finished of $total, $((left / 60)) min $((left % 60)) s left: $(tail -n 1 "$out/seed_$seed.log")"
  rm -f "$out/seed_$seed.log"
}

stop_code=0
say "$total seeds, $jobs in parallel, output in $out"
for ((seed = first; seed <= last && stop_code == 0; ++seed)); do
  [ "${#seed_of[@]}" -lt "$jobs" ] || finish_one
  [ "$stop_code" != 0 ] || start "$seed"
done
while [ "${#seed_of[@]}" -gt 0 ]; do finish_one; done
[ "$stop_code" = 0 ] || exit "$stop_code"
trap - INT TERM
"$experiment" report --out "$out" --first "$first" --last "$last"
say "figures: $out/figures, $out/robots.png"
