#!/usr/bin/env bash
# Runs the fleet over a recording as fast as it can, no frame lost, same bytes each time.
# usage: scripts/replay.sh DATASET --out DIR [--config FILE]
. "$(dirname "$0")/common.sh"
run omnifleet_launch replay "$@"
