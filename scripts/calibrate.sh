#!/usr/bin/env bash
# Calibrates a lens with images of a chessboard: writes sensor.yaml with its reprojection error, prints the error per image.
# usage: scripts/calibrate.sh IMAGES_DIR --board COLSxROWS --square-m S --out sensor.yaml
#        [--projection kannala_brandt|ocam|equidistant|equisolid|stereographic|orthographic|pinhole]
#        [--match PATTERN] [--fov-deg DEG] [--max-rms-px PX]
. "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"
run omnifleet_calibrate "$@"
