#!/usr/bin/env bash
# Measures what the visual compass and the difference of signatures give to the localizer: paths with and without them,
# with and without wheels. "With" has the compass correct wheels, too (with_wheels). The variant follows from the seed: a well lit
# furnished room, a dim one, one in which the wheels
# slip for 12 seconds (independent renderer, tests/raycast), and an arena of free-standing obstacles. Prints four
# rows per seed as it finishes, then the medians and the worst values by variant and wheels; writes them to OUT/table.txt.
# Finished runs are not repeated: after Ctrl-C the same command continues.
# Remove OUT/seed_*/{wheels,no_wheels}_* to measure again on the same recordings.
# usage: scripts/experiments/appearance.sh [--seeds A-B] [--out DIR] [--quick] [--jobs N]
#        defaults: --seeds 1000-1007, --out out/appearance, --jobs 1 (each seed uses all cores); --quick: only the first
#        four seeds. OMNIFLEET_SKIP_BUILD=1 uses the programs as they are.
# A row: share of all frames with a valid pose; mean and maximum error of the paths; mean error of the headings; NEES (3
# if consistent); shape difference of the topological map (Fernandez et al. 2011 IV.B) and its number of nodes, of the worst
# robot each.
. "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/seeds.sh"

out="$root/out/appearance" first=1000 last=1007 jobs=1 quick_seeds=4 default_domain=120
read_options '--seeds|--out|--quick|--jobs' "$@"
build_programs raycast_room
need_build
mkdir -p "$out"
out="$(cd "$out" && pwd)"

variants=("lit room" "dim room" "slip" "arena")
options=("--loop --fast" "--loop --fast --dim --vga" "--robots 1 --frames 200 --fast --slip 10-22" "")

make_recording() {
  local variant=$((seed % 4))
  if [ "$variant" = 3 ]; then
    step "$build/bin/omnifleet_make_recording" "$root/config/arenas/demo.yaml" --out "$folder/unfinished" --seed "$seed" --random --no-ceiling --quiet
  else
    # shellcheck disable=SC2086  # words
    step "$build/tests/raycast_room" "$folder/unfinished" "$seed" ${options[$variant]}
  fi
}

# Prints a row from the metrics: SEED WHEELS APPEARANCE FILE
row_of() {
  awk -v seed="$1" -v variant="${variants[$(($1 % 4))]}" -v wheels="$2" -v appearance="$3" "$metrics_awk"'
    END {
      shape = nodes = "-"
      for (path in v) {
        if (path ~ /\/places_shape_difference$/ && (shape == "-" || v[path] + 0 > shape + 0)) shape = v[path]
        if (path ~ /^paths\/[^\/]*\/places$/ && (nodes == "-" || v[path] + 0 < nodes + 0)) nodes = v[path]
      }
      printf "%d\t%s\t%s\t%s\t%s\t%s\t%s\t%s\t%s\t%s\t%s\n", seed, variant, wheels, appearance,
        (frames > 0 ? sprintf("%.1f", 100 * v["paths_mean/poses"] / frames) : "-"), number("paths_mean/distance_m", 100, 2),
        number("paths_mean/max_m", 100, 2), number("paths_mean/heading_rad", 57.29578, 3),
        number("paths_mean/consistency/nees_mean", 1, 2),
        (shape == "-" ? shape : sprintf("%.1e", shape)), nodes
    }' "$4"
}

# Four runs of a seed.
run_seed() {
  local wheels appearance overlay
  record "$folder" "${variants[$((seed % 4))]}: ${options[$((seed % 4))]}" make_recording
  for wheels in wheels no_wheels; do
    for appearance in with without; do
      overlay="$folder/${wheels}_$appearance.yaml"
      printf 'services:\n  localizer: {estimator: {appearance: {use: %s, with_wheels: true}}}\n' \
        "$([ "$appearance" = with ] && echo true || echo false)" >"$overlay"
      [ "$wheels" = wheels ] || printf '  local_mapper: {wheels: {use: false}}\n' >>"$overlay"
      replay "$folder/recording" "$folder/${wheels}_$appearance" --config "$overlay"
    done
  done
  write_row rows_of
}

rows_of() {
  local wheels appearance
  for wheels in wheels no_wheels; do
    for appearance in with without; do
      row_of "$seed" "${wheels/_/ }" "$appearance" "$folder/${wheels}_$appearance/metrics.json"
    done
  done
}

layout() {
  awk -F '\t' '{ printf "%8s  %-9s %-9s %-10s %9s %8s %8s %8s %7s %8s %6s\n", $1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11 }'
}

heading() {
  printf 'seed\tvariant\twheels\tappearance\tlocalized\tmean\tmax\theading\tNEES\tshape\tnodes\n' | layout
  printf '\t\t\t\t%%\tcm\tcm\tdeg\t\t\t\n' | layout
}

show_seed() { layout <"$out/seed_$1/row"; }

# Median and worst value of each column by variant, wheels and appearance. Small is worse for "localized" and the nodes.
summary() {
  awk -F '\t' '
    {
      group = $2 "\t" $3 "\t" $4
      if (!(group in known)) { known[group] = 1; groups[++group_count] = group }
      for (c = 5; c <= 11; ++c) if ($c != "-") sample[group, c, ++count[group, c]] = $c
    }
    END {
      for (g = 1; g <= group_count; ++g) {
        group = groups[g]; median = ""; worst = ""
        for (c = 5; c <= 11; ++c) {
          n = count[group, c]
          for (i = 2; i <= n; ++i)
            for (j = i; j > 1 && sample[group, c, j - 1] + 0 > sample[group, c, j] + 0; --j) {
              swap = sample[group, c, j]; sample[group, c, j] = sample[group, c, j - 1]; sample[group, c, j - 1] = swap
            }
          middle = n % 2 ? sample[group, c, (n + 1) / 2] : (sample[group, c, n / 2] + sample[group, c, n / 2 + 1]) / 2
          median = median "\t" (n == 0 ? "-" : sprintf(c == 10 ? "%.1e" : "%." (c == 8 ? 3 : c == 5 ? 1 : c == 11 ? 0 : 2) "f", middle))
          worst = worst "\t" (n == 0 ? "-" : c == 5 || c == 11 ? sample[group, c, 1] : sample[group, c, n])
        }
        print "median\t" group median
        print "worst\t" group worst
      }
    }' | layout
}

run_seeds
write_table
check_failures
