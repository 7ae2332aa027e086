#!/usr/bin/env bash
# How every service of a running fleet is: state, rate, latency, what was rejected, the last error.
# usage: scripts/status.sh [--domain N] [--once]
. "$(dirname "$0")/common.sh"
run omnifleet_status "$@"
