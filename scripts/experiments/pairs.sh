#!/usr/bin/env bash
# Measures how a robot without initial pose finds the map of another one, on pairs of recordings of the independent
# renderer (tests/raycast). The kind follows from the seed: two seeds of four show two robots in the same room, one two
# rooms that look alike (same walls, other furniture), one two unlike rooms; every second four seeds have decorated
# rooms. Prints one row per seed as it finishes, then the totals; writes them to OUT/table.txt. Finished seeds are not
# repeated: after Ctrl-C the same command continues. Remove OUT/seed_*/run to measure again on the same recordings.
# usage: scripts/experiments/pairs.sh [--seeds A-B] [--out DIR] [--quick] [--jobs N] [--width PIXELS]
#        defaults: --seeds 1000-1099, --out out/pairs, --jobs 1 (each seed uses all cores), --width 640; --quick: only
#        the first four seeds. OMNIFLEET_SKIP_BUILD=1 uses the programs as they are.
# A row: status of r2 in merge.json; verdict: right, missed (same room, no match), WRONG (matched, or with a path in the
# common map, in another room, or in the same room with a mean error above 5 cm or 1.5 degrees), LEAK (another room, not
# matched, but r2 observed an object of the common map); time of the match as a share of the run; mean errors of r2's
# poses from then on; score of the match; share of r2's frames within 0.8 m of r1's path.
. "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/seeds.sh"

out="$root/out/pairs" first=1000 last=1099 jobs=1 width=640 quick_seeds=4
read_options '--seeds|--out|--quick|--jobs|--width' "$@"
build_programs raycast_room
need_build
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

# Prints the row of a seed: FOLDER SEED KIND.
row_of() {
  local run="$1/run" truth="$1/recording/groundtruth" status score time share cm deg verdict
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
  printf '%s\t%s\t%s\t%s\t%s\t%s\t%s\t%s\t%s\n' "$2" "$3" "$status" "$verdict" "$share" "$cm" "$deg" \
    "$(awk -v s="$score" 'BEGIN { print (s == "-" ? s : sprintf("%.2f", s)) }')" "$overlap"
}

layout() {
  awk -F '\t' '{ printf "%6s  %-10s %-10s %-8s %6s %8s %8s %6s %8s\n", $1, $2, $3, $4, $5, $6, $7, $8, $9 }'
}

heading() {
  printf 'seed\tkind\tstatus\tverdict\ttime\terror\theading\tscore\toverlap\n' | layout
  printf '\t\t\t\t%%\tcm\tdeg\t\t\n' | layout
}

summary() {
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

# Recording, run, evaluation, row.
run_seed() {
  local kind arguments
  kind="$(kind_of "$seed")"
  arguments="--pair $kind"
  [ $((seed / 4 % 2)) = 0 ] || arguments+=" --decorated"
  arguments+=" --frames 120 --width $width"
  # shellcheck disable=SC2086  # words
  record "$folder" "$arguments" "$build/tests/raycast_room" "$folder/unfinished" "$seed" $arguments
  replay "$folder/recording" "$folder/run"
  write_row row_of "$folder" "$seed" "$kind"
}

show_seed() { layout <"$out/seed_$1/row"; }
show_failure() { printf '%s\t%s\tfailed: %s\n' "$1" "$(kind_of "$1")" "$out/seed_$1/log" | layout; }

run_seeds
write_table
check_failures
