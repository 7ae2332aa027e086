#!/usr/bin/env bash
# Fits the scale between the distances that a robot's camera and a ceiling camera see (Ahmed et al. 2013, eq. 1-2), prints the
# residuals beside the paper's polynomial. Distances outside of the fitted interval are refused (exit code 2).
# --overlay writes an overlay that gives the fit to the method of config/papers/ahmed.yaml.
# usage: scripts/fit_scale.sh PAIRS.csv --out scale.yaml [--overlay FILE --metres-per-ceiling-px M] [--plot alpha.png]
#        [--degree N] [--at PX ...]
. "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"
run omnifleet_fit_scale "$@"
