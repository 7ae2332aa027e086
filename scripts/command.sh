#!/usr/bin/env bash
# Tells a running fleet its formation; what is not given stays as it is.
# usage: scripts/command.sh FLEET.yaml [--shape line|column|wedge|triangle] [--distance M] [--angle RAD]
#        [--waypoints X,Y …] [--halt] [--wait S]
. "$(dirname "$0")/common.sh"
run omnifleet_command "$@"
