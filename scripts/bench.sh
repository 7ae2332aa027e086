#!/usr/bin/env bash
# Every hot path beside its naive peer in one run: Google Benchmark's report, then a table of ours, peer, ratio,
# budget and whether it is reached. Installs and builds what is missing. Takes about four minutes.
# usage: scripts/bench.sh [--smoke] [Google Benchmark options, e.g. --benchmark_filter=map --benchmark_out=FILE]
. "$(dirname "$0")/common.sh"

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
