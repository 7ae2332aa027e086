#!/usr/bin/env bash
# Shows the status of every service of a running fleet: state, rate, latency, rejected samples, last error.
# usage: scripts/status.sh [--domain N] [--once]
. "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"
run omnifleet_status "$@"
