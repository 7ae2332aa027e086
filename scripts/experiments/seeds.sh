# shellcheck shell=bash
# Sourced by the experiments; not a program. One process per seed, several at once.
# An experiment sets defaults (out, first, last, jobs, …), calls read_options, build_programs and run_seeds, and defines
#   heading         prints the heading of the table
#   run_seed        one seed, in a process of its own, with $seed, $folder (OUT/seed_N) and $domain (of DDS)
#   show_seed SEED  prints the result of a seed; may set note, a text that ends the progress line
# It may redefine show_failure. With rows (write_row, write_table) it also defines
#   layout          aligns the columns of tab-separated rows
#   summary         prints the totals of tab-separated rows
. "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/../common.sh"

script="${0##*/}"
most_jobs=40       # upper limit of --jobs
quick_seeds=1      # number of seeds with --quick
default_domain=30  # DDS domain of the first process without OMNIFLEET_DOMAIN; the others follow

# refuse TEXT: ends the script because of a wrong option.
refuse() { say "$script: $*"; exit 2; }

# read_options 'OPTION|OPTION…' ARGUMENT…: the first argument names those of --seeds, --out, --quick, --jobs and --width
# that the script knows. Sets first, last, out, quick (0 or 1), jobs and width. --quick keeps the first $quick_seeds seeds.
read_options() {
  local known="$1"
  shift
  quick=0
  while [ $# -gt 0 ]; do
    [[ "$1" =~ ^(-h|--help|$known)$ ]] || refuse "unknown option $1"
    case "$1" in
      -h|--help) awk 'NR > 1 { if (!/^#/) exit; print substr($0, 3) }' "$0"; exit 0 ;;
      --quick) quick=1; shift; continue ;;
      --seeds)
        [[ "${2:-}" =~ ^([0-9]{1,10})-([0-9]{1,10})$ ]] || refuse "--seeds needs two numbers, A-B"
        first=$((10#${BASH_REMATCH[1]})) last=$((10#${BASH_REMATCH[2]}))
        [ "$first" -le "$last" ] || refuse "--seeds $2 is empty" ;;
      --out) out="${2:-}"; [ -n "$out" ] || refuse "--out needs a directory" ;;
      --jobs)
        jobs="${2:-}"
        [[ "$jobs" =~ ^[1-9][0-9]{0,3}$ && "$jobs" -le "$most_jobs" ]] || refuse "--jobs needs a number from 1 to $most_jobs" ;;
      --width) width="${2:-}"; [[ "$width" =~ ^[1-9][0-9]*$ ]] || refuse "--width needs a positive number" ;;
    esac
    shift 2
  done
  [ "$quick" = 0 ] || last=$((last < first + quick_seeds ? last : first + quick_seeds - 1))
}

# build_programs TARGET…: builds omnifleet and programs of the tests. OMNIFLEET_SKIP_BUILD=1 uses those that exist.
build_programs() {
  local target
  if [ "${OMNIFLEET_SKIP_BUILD:-0}" = 0 ]; then
    "$root/scripts/setup.sh" >&2
    cmake --build "$build" --target "$@" -j "$(nproc)" >&2
  fi
  for target in "$@"; do
    [ -x "$build/tests/$target" ] || { say "$script: $build/tests/$target is not built"; exit 1; }
  done
}

# Ends the processes that this shell has started and waits for them.
end_children() {
  trap '' INT TERM
  # shellcheck disable=SC2046  # words
  kill $(jobs -p) 2>/dev/null || true
  wait
}

# The functions from here to write_row are for run_seed.
# attempt COMMAND…: runs a program with its output in FOLDER/log.
attempt() { "$@" >>"$folder/log" 2>&1 & wait $!; }

# step COMMAND…: runs a program; ends the seed with the exit code of the program if that is not 0.
step() {
  local code=0
  attempt "$@" || code=$?
  [ "$code" = 0 ] || { say "$1 returned $code" 2>>"$folder/log"; exit "$code"; }
}

# record AT ARGUMENTS COMMAND…: AT/recording by a command that makes AT/unfinished. It is kept as long as ARGUMENTS, one
# text, stays the same. A new recording removes the runs in AT.
record() {
  [ ! -e "$1/recording" ] || [ "$2" != "$(cat "$1/recording.arguments" 2>/dev/null)" ] || return 0
  mkdir -p "$1"
  find "$1" -mindepth 1 -maxdepth 1 ! -name log -exec rm -rf {} +
  step "${@:3}"
  printf '%s\n' "$2" >"$1/recording.arguments"
  mv "$1/unfinished" "$1/recording"
}

# replay RECORDING RUN OPTION…: runs omnifleet on a recording and evaluates the run, unless RUN has metrics.
replay() {
  [ ! -e "$2/metrics.json" ] || return 0
  rm -rf "$2"
  OMNIFLEET_DOMAIN="$domain" step "$root/scripts/replay.sh" "$1" --out "$2" "${@:3}"
  step "$root/scripts/evaluate.sh" "$2" "$1"
}

# Rules of awk that read metrics.json: v[PATH] is a value by its path (paths_mean/distance_m), frames and robots are those of
# all paths; number(PATH, FACTOR, DECIMALS) prints a value, - without it. JSON is indented by two.
# shellcheck disable=SC2034  # of the experiments
metrics_awk='
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
'

# write_row COMMAND…: the output of a command is the row of the seed.
write_row() { "$@" >"$folder/row.part" 2>>"$folder/log"; mv "$folder/row.part" "$folder/row"; }

# The process of a seed: SEED DOMAIN.
seed_process() {
  local seed="$1" domain="$2" folder="$out/seed_$1"
  trap '' INT  # Ctrl-C reaches the main process, which sends SIGTERM
  trap 'end_children; exit 143' TERM
  mkdir -p "$folder"
  rm -f "$folder/row"
  run_seed
}

# show_failure SEED CODE: says that a seed failed; the end of its log follows.
show_failure() { say "seed $1 failed: $out/seed_$1/log"; }

# Waits for one seed and prints its result and the progress.
finish_one() {
  local pid code=0 note="" seed left
  wait -n -p pid || code=$?
  seed="${seed_of[$pid]}"
  unset "busy[${slot_of[$pid]}]" "seed_of[$pid]" "slot_of[$pid]"
  finished=$((finished + 1))
  [ "$code" != 0 ] || show_seed "$seed" || code=$?
  if [ "$code" != 0 ]; then
    failed=$((failed + 1))
    show_failure "$seed" "$code"
    tail -n 3 "$out/seed_$seed/log" >&2 || true
  fi
  left=$(((SECONDS - began) * (total - finished) / finished))
  say "$finished of $total, $((left / 60)) min $((left % 60)) s left${note:+: $note}"
}

# Runs the seeds from first to last, $jobs at once. Sets total and failed (numbers of seeds) and next (the seed that starts
# next). Ctrl-C ends all with exit code 130.
run_seeds() {
  local -A seed_of=() slot_of=() busy=()
  local finished=0 began=$SECONDS slot
  total=$((last - first + 1)) failed=0 next="$first"
  trap 'end_children; say "$script: stopped; the same command continues from here"; exit 130' INT TERM
  say "$total seeds, $jobs in parallel, output in $out"
  heading
  while [ "$next" -le "$last" ] || [ "${#seed_of[@]}" -gt 0 ]; do
    if [ "$next" -gt "$last" ] || [ "${#seed_of[@]}" -ge "$jobs" ]; then finish_one; continue; fi
    slot=0
    while [ -n "${busy[$slot]:-}" ]; do slot=$((slot + 1)); done
    seed_process "$next" $((${OMNIFLEET_DOMAIN:-$default_domain} + slot)) &
    seed_of[$!]="$next" slot_of[$!]="$slot" busy[$slot]=1
    next=$((next + 1))
  done
  trap - INT TERM
}

# Prints the totals of all rows and writes OUT/table.txt: heading, rows, totals.
write_table() {
  local seed rows=()
  for ((seed = first; seed <= last; ++seed)); do
    [ ! -e "$out/seed_$seed/row" ] || rows+=("$out/seed_$seed/row")
  done
  if [ "${#rows[@]}" -gt 0 ]; then
    cat "${rows[@]}" | summary
    { heading; cat "${rows[@]}" | layout; cat "${rows[@]}" | summary; } >"$out/table.txt"
  fi
  say "table: $out/table.txt"
}

# The last command of an experiment: exit code 1 if a seed failed.
check_failures() { [ "$failed" = 0 ] || { say "$script: $failed of $total seeds failed"; exit 1; }; }
