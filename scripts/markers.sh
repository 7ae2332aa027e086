#!/usr/bin/env bash
# Picks the colours of robots' markers in an image of a ceiling camera: writes markers.yaml and a picture of the regions.
# usage: scripts/markers.sh IMAGE --robot NAME --cover X,Y --tail X,Y --head X,Y [--robot …] GEOMETRY --out markers.yaml
#        scripts/markers.sh IMAGE --team X,Y --robot NAME --individual X,Y [--robot …] GEOMETRY --out markers.yaml
# GEOMETRY: --from markers.yaml, or --height-m H with --cover-size-m X,Y --tail-offset-m X,Y --tail-size-m X,Y
#        --head-offset-m X,Y --head-size-m X,Y; patches: --team-offset-m X,Y --individual-offset-m X,Y --patch-size-m X,Y
. "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"
run omnifleet_pick_markers "$@"
