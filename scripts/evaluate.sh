#!/usr/bin/env bash
# Compares a run with the truth of its recording: prints the table, writes OUT/metrics.json.
# usage: scripts/evaluate.sh OUT DATASET [--align fleet]
. "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"
run omnifleet_evaluate "$@"
