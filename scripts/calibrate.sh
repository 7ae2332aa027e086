#!/usr/bin/env bash
# A lens from pictures of a chessboard: writes sensor.yaml with its reprojection error, prints the error per image.
# usage: scripts/calibrate.sh IMAGES_DIR --board COLSxROWS --square_m S --out sensor.yaml
#        [--projection kannala_brandt|ocam|equidistant|equisolid|stereographic|orthographic|pinhole]
#        [--match PATTERN] [--fov_deg DEG] [--max_rms_px PX]
. "$(dirname "$0")/common.sh"
run omnifleet_calibrate "$@"
