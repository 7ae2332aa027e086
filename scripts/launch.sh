#!/usr/bin/env bash
# Starts a fleet: one process per service and robot.
# usage: scripts/launch.sh FLEET.yaml [--out DIR] [--duration S] [--host NAME] [--record] [--realtime]
. "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"
run omnifleet_launch run "$@"
