#!/usr/bin/env bash
# Sends a formation command to a running fleet; values that are not given stay unchanged.
# usage: scripts/command.sh FLEET.yaml [--behaviour formation|boundary_following|exploration] [--boundary M]
#        [--shape line|column|wedge|triangle] [--distance M] [--angle RAD]
#        [--waypoints X,Y …] [--halt] [--wait S]
. "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"
run omnifleet_command "$@"
