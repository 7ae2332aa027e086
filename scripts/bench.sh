#!/usr/bin/env bash
# Every hot path beside its naive peer, in one run; prints medians and ratios.
# usage: scripts/bench.sh [Google Benchmark options]
. "$(dirname "$0")/common.sh"
"$root/scripts/setup.sh" --with-tests >&2
exec "$build/tests/omnifleet_bench" --benchmark_repetitions=5 --benchmark_report_aggregates_only=true "$@"
