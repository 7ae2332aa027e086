#!/usr/bin/env bash
# Draws the robots' poses and the map of a run into the last image of each ceiling camera of its recording:
# OUT/ceiling/<camera>_tracking.png and <camera>_map.png.
# usage: scripts/ceiling_view.sh OUT DATASET
. "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"
run omnifleet_ceiling_view "$@"
