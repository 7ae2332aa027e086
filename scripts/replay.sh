#!/usr/bin/env bash
# Replays a recording at full speed, without losing frames; every run writes identical files.
# usage: scripts/replay.sh DATASET --out DIR [--config FILE]
. "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"
run omnifleet_launch replay "$@"
