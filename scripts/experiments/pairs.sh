#!/usr/bin/env bash
# Measures how a robot without initial pose finds the map of another one, on pairs of recordings of the independent
# renderer (tests/raycast). The kind follows from the seed: two seeds of four show two robots in the same room, one two
# rooms that look alike (same walls, other furniture), one two unlike rooms; every second four seeds have decorated
# rooms. Prints one row per seed as it finishes, then the totals; writes them to OUT/table.txt. Finished seeds are not
# repeated: after Ctrl-C the same command continues. Remove OUT/seed_*/run to measure again on the same recordings.
# usage: scripts/experiments/pairs.sh [--seeds A-B] [--out DIR] [--quick] [--jobs N] [--width PIXELS]
#        defaults: --seeds 1000-1099, --out out/pairs, --jobs 1 (each seed uses all cores), --width 640; --quick: only
#        the first four seeds. OMNIFLEET_SKIP_BUILD=1 uses the programs as they are.
# A row: status of r2 in merge.json; verdict: right, missed (same room, no match), WRONG (matched in another room, or
# in the same room with a mean error above 5 cm or 1.5 degrees), LEAK (not matched, but r2 has a path in the common
# map or observed an object of it); time of the match as a share of the run; mean errors of r2's poses from then on;
# cells of the common map that differ from a run of r1 alone (other rooms only; some dozens, because with another robot
# in the fleet an object may be that robot); share of r2's frames within 0.8 m of r1's path.
. "$(dirname "$0")/../common.sh"

out="$root/out/pairs" first=1000 last=1099 quick=0 jobs=1 width=640
while [ $# -gt 0 ]; do
  case "$1" in
    --seeds)
      [[ "${2:-}" =~ ^([0-9]+)-([0-9]+)$ ]] || { say "pairs.sh: --seeds needs two numbers, A-B"; exit 2; }
      first="${BASH_REMATCH[1]}" last="${BASH_REMATCH[2]}"; shift 2 ;;
    --out) out="${2:?--out needs a directory}"; shift 2 ;;
    --jobs) jobs="${2:?--jobs needs a number}"; shift 2 ;;
    --width) width="${2:?--width needs a number of pixels}"; shift 2 ;;
    --quick) quick=1; shift ;;
    -h|--help) sed -n '2,14p' "$0" | cut -c3-; exit 0 ;;
    *) say "pairs.sh: unknown option $1"; exit 2 ;;
  esac
done
[ "$quick" = 0 ] || last=$((last < first + 3 ? last : first + 3))
[ "$first" -le "$last" ] || { say "pairs.sh: --seeds $first-$last is empty"; exit 2; }
[[ "$jobs" =~ ^[1-9][0-9]?$ && "$jobs" -le 40 ]] || { say "pairs.sh: --jobs needs a number from 1 to 40"; exit 2; }
[[ "$width" =~ ^[1-9][0-9]*$ ]] || { say "pairs.sh: --width needs a positive number"; exit 2; }

if [ "${OMNIFLEET_SKIP_BUILD:-0}" = 0 ]; then
  "$root/scripts/setup.sh" >&2
  cmake --build "$build" --target raycast_room -j "$(nproc)" >&2
fi
need_build
room="$build/tests/raycast_room"
[ -x "$room" ] || { say "pairs.sh: $room is not built"; exit 1; }
mkdir -p "$out"

kinds=(same same lookalike disjoint)
kind_of() { printf '%s' "${kinds[$(($1 % 4))]}"; }

# Fields of r2 in merge.json, tab-separated: status, score, time_s. JSON is indented by two.
merge_of() {
  awk '
    match($0, /^ +"[^"]+": /) {
      depth = (index($0, "\"") - 1) / 2
      key[depth] = substr($0, 2 * depth + 2, RLENGTH - 2 * depth - 4)
      value = substr($0, RLENGTH + 1)
      sub(/,$/, "", value)
      gsub(/^"|"$/, "", value)
      if (depth == 3 && key[2] == "r2") v[key[3]] = value
    }
    function given(name) { return name in v && v[name] != "null" ? v[name] : "-" }
    END { printf "%s\t%s\t%s\n", given("status"), given("score"), given("time_s") }' "$1"
}

# Share of the run at a time (s; absolute, or from the first frame), and the mean errors (cm, degrees) of the poses
# from then on: TIME TRUTH ESTIMATE.
errors_of() {
  awk -v at="$1" '
    /^#/ || NF < 8 { next }
    FNR == NR { x[$1] = $2; y[$1] = $3; yaw[$1] = 2 * atan2($7, $8); if (begin == "") begin = $1; end = $1; next }
    FNR == 1 || !ready { ready = 1; if (at != "-" && at < begin) at += begin }
    ($1 in x) && (at == "-" || $1 >= at - 1e-6) {
      turn = 2 * atan2($7, $8) - yaw[$1]
      turn = atan2(sin(turn), cos(turn))
      away += sqrt(($2 - x[$1]) ^ 2 + ($3 - y[$1]) ^ 2)
      turned += turn < 0 ? -turn : turn
      ++n
    }
    END {
      if (!ready && at != "-" && at < begin) at += begin
      printf "%s\t", at == "-" ? "-" : sprintf("%.0f", 100 * (at - begin) / (end - begin))
      if (n > 0) printf "%.2f\t%.3f\n", 100 * away / n, 57.29578 * turned / n
      else print "-\t-"
    }' "$2" "$3"
}

# Number of cells in which two maps differ: MAP.pgm MAP.pgm. Of maps of unequal size, the difference of their
# numbers of known cells, at least 1.
differing_cells() {
  if cmp -s "$1" "$2"; then echo 0; return; fi
  if [ "$(head -n 2 "$1")" = "$(head -n 2 "$2")" ]; then  # width and height
    { cmp -l "$1" "$2" || true; } | wc -l
    return
  fi
  local known=()
  for map in "$1" "$2"; do
    known+=("$(od -An -v -tu1 -w1 "$map" | awk '$1 != 205 { ++n } END { print n + 0 }')")
  done
  awk -v a="${known[0]}" -v b="${known[1]}" 'BEGIN { d = a - b; if (d < 0) d = -d; print (d > 0 ? d : 1) }'
}

# Prints the row of a seed: FOLDER SEED KIND.
row_of() {
  local run="$1/run" truth="$1/recording/groundtruth" status score time share cm deg cells=- verdict
  if [ -e "$run/merge.json" ]; then
    IFS=$'\t' read -r status score time < <(merge_of "$run/merge.json")
  else
    status=unreported score=- time=-
  fi
  local path="$run/trajectories/r2.tum" merged=0
  [ ! -e "$path" ] || ! grep -qv '^#' "$path" || merged=1
  [ "$merged" = 1 ] || path=/dev/null
  IFS=$'\t' read -r share cm deg < <(errors_of "$time" "$truth/r2.tum" "$path")
  [ "$status" != undecided ] && [ "$status" != refused ] || share=-
  [ "$3" = same ] || [ "$merged" = 0 ] || cm=- deg=-
  [ ! -e "$1/alone/map.pgm" ] || cells="$(differing_cells "$run/map.pgm" "$1/alone/map.pgm")"
  if [ "$status" = matched ] || [ "$merged" = 1 ]; then
    verdict=WRONG
    [ "$3" != same ] ||
      verdict="$(awk -v cm="$cm" -v deg="$deg" 'BEGIN { print (cm != "-" && cm <= 5 && deg <= 1.5 ? "right" : "WRONG") }')"
  elif [ "$3" = same ]; then
    verdict=missed
  else
    verdict=right
    ! grep -q '"r2"' "$run/objects.geojson" || verdict=LEAK
  fi
  local overlap
  overlap="$(awk -F '[:,]' '/"overlap"/ { printf "%.2f", $2 }' "$truth/pair.json")"
  printf '%s\t%s\t%s\t%s\t%s\t%s\t%s\t%s\t%s\t%s\n' "$2" "$3" "$status" "$verdict" "$share" "$cm" "$deg" \
    "$(awk -v s="$score" 'BEGIN { print (s == "-" ? s : sprintf("%.2f", s)) }')" "$cells" "$overlap"
}

layout() {
  awk -F '\t' '{ printf "%6s  %-10s %-10s %-8s %6s %8s %8s %6s %7s %8s\n", $1, $2, $3, $4, $5, $6, $7, $8, $9, $10 }'
}

heading() {
  printf 'seed\tkind\tstatus\tverdict\ttime\terror\theading\tscore\tcells\toverlap\n' | layout
  printf '\t\t\t\t%%\tcm\tdeg\t\tof r2\t\n' | layout
}

totals() {
  awk -F '\t' '
    function middle(count, k, i, j, swap) {
      for (i = 2; i <= count; ++i)
        for (j = i; j > 1 && time[j - 1] + 0 > time[j] + 0; --j) { swap = time[j]; time[j] = time[j - 1]; time[j - 1] = swap }
      if (count == 0) return "-"
      k = int(count / 2)
      return sprintf("%.0f %%", count % 2 ? time[k + 1] : (time[k] + time[k + 1]) / 2)
    }
    {
      ++pairs
      if ($2 == "same") ++same
      if ($2 == "same" && $4 == "right") { ++found; if ($5 != "-") { time[++times] = $5; if ($5 < 50) ++early } }
      if ($4 == "WRONG") ++wrong
      if ($4 == "LEAK") ++leaks
      if ($3 == "refused") ++refused
      if ($3 == "undecided") ++undecided
    }
    END {
      printf "%d pairs: recall %d of %d in the same room (%s), %d of them before half of the run, median at %s; ", pairs,
        found, same, (same > 0 ? sprintf("%.2f", found / same) : "-"), early, middle(times)
      printf "%d wrong merges, %d leaks into the common map; refused %d, undecided %d\n", wrong, leaks, refused, undecided
    }'
}

# The recording without r2: RECORDING FOLDER.
without_r2() {
  mkdir -p "$2"
  awk '/^  r2:/ { exit } { print }' "$1/dataset.yaml" >"$2/dataset.yaml"
  ln -sfn "$(cd "$1" && pwd)/r1" "$2/r1"
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
  local kind arguments
  kind="$(kind_of "$seed")"
  arguments="--pair $kind"
  [ $((seed / 4 % 2)) = 0 ] || arguments+=" --decorated"
  arguments+=" --frames 120 --width $width"
  if [ ! -e "$folder/recording" ] || [ "$arguments" != "$(cat "$folder/recording.arguments" 2>/dev/null)" ]; then
    rm -rf "$folder/recording" "$folder/unfinished" "$folder/run" "$folder/alone"
    # shellcheck disable=SC2086  # words
    step "$room" "$folder/unfinished" "$seed" $arguments
    printf '%s\n' "$arguments" >"$folder/recording.arguments"
    mv "$folder/unfinished" "$folder/recording"
  fi
  if [ ! -e "$folder/run/metrics.json" ]; then
    rm -rf "$folder/run" "$folder/alone"
    OMNIFLEET_DOMAIN="$domain" step "$root/scripts/replay.sh" "$folder/recording" --out "$folder/run"
    if [ "$kind" != same ]; then
      without_r2 "$folder/recording" "$folder/recording_alone"
      OMNIFLEET_DOMAIN="$domain" step "$root/scripts/replay.sh" "$folder/recording_alone" --out "$folder/alone"
    fi
    step "$root/scripts/evaluate.sh" "$folder/run" "$folder/recording"
  fi
  row_of "$folder" "$seed" "$kind" >"$folder/row.part" 2>>"$folder/log"
  mv "$folder/row.part" "$folder/row"
}

declare -A seed_of=() slot_of=() busy=()
stop() {
  trap '' INT TERM
  [ "${#seed_of[@]}" = 0 ] || kill "${!seed_of[@]}" 2>/dev/null || true
  wait
  say "pairs.sh: stopped; the same command continues from here"
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
    printf '%s\t%s\tfailed: %s\n' "$seed" "$(kind_of "$seed")" "$out/seed_$seed/log" | layout
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
  cat "${rows[@]}" | totals
  { heading; cat "${rows[@]}" | layout; cat "${rows[@]}" | totals; } >"$out/table.txt"
fi
say "table: $out/table.txt"
[ "$failed" = 0 ] || { say "pairs.sh: $failed of $total seeds failed"; exit 1; }
