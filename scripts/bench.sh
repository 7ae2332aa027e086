#!/usr/bin/env bash
# Benchmarks every hot path against a naive peer in one run. Prints the report of Google Benchmark, then a table of own
# time, peer time, ratio, budget and result. Installs and builds missing parts. Takes about four minutes.
# usage: scripts/bench.sh [--smoke] [Google Benchmark options, e.g. --benchmark_filter=map --benchmark_out=FILE]
. "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"

usage() { sed -n '2,4p' "$0" | cut -c3-; }
for argument in "$@"; do
  case "$argument" in
    -h|--help) usage; exit 0 ;;
    --smoke|--benchmark_*) ;;
    *) say "bench.sh: unknown option $argument"; usage >&2; exit 2 ;;
  esac
done
"$root/scripts/setup.sh" >&2
cmake --build "$build" --target omnifleet_bench -j 2 >&2
exec "$build/tests/omnifleet_bench" "$@"
