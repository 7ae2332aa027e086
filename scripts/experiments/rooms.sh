#!/usr/bin/env bash
# Measures omnifleet in furnished rooms of the independent renderer (tests/raycast), one new room per seed. The variant
# follows from the seed: one robot, three robots, images by distance, a dim room, two rooms joined by a door. Prints one
# row per seed as it finishes, then the medians and the worst values; writes them to OUT/table.txt. Finished seeds are
# not repeated: after Ctrl-C the same command continues. Remove OUT/seed_*/run to measure again on the same recordings.
# usage: scripts/experiments/rooms.sh [--seeds A-B] [--out DIR] [--quick] [--jobs N] [--width PIXELS]
#        defaults: --seeds 1000-1019, --out out/rooms, --jobs 1 (each seed uses all cores), --width 640; --quick: only
#        the first three seeds. OMNIFLEET_SKIP_BUILD=1 uses the programs as they are.
. "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/seeds.sh"

out="$root/out/rooms" first=1000 last=1019 jobs=1 width=640 quick_seeds=3
read_options '--seeds|--out|--quick|--jobs|--width' "$@"
build_programs raycast_room
need_build
mkdir -p "$out"

variants=("one robot" "three robots" "by distance" "dim" "two rooms")
options=("--robots 1 --frames 200" "--robots 3 --frames 200" "--by-distance --frames 191" "--dim --frames 200"
  "--rooms 2 --frames 200")

# Prints the row of a seed from the metrics.
row_of() {
  awk -v seed="$1" -v variant="$2" "$metrics_awk"'
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
    }' | layout
}

# Recording, run, evaluation, row.
run_seed() {
  local variant=$((seed % 5))
  local arguments="${options[$variant]} --width $width"
  # shellcheck disable=SC2086  # words
  record "$folder" "$arguments" "$build/tests/raycast_room" "$folder/unfinished" "$seed" $arguments
  replay "$folder/recording" "$folder/run"
  write_row row_of "$seed" "${variants[$variant]}" "$folder/run/metrics.json"
}

show_seed() { layout <"$out/seed_$1/row"; }
show_failure() { printf '%s\t%s\tfailed: %s\n' "$1" "${variants[$(($1 % 5))]}" "$out/seed_$1/log" | layout; }

run_seeds
write_table
check_failures
