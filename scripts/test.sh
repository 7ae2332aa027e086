#!/usr/bin/env bash
# Everything: installs, builds, runs all tests, ends with ctest's summary and what was skipped.
# usage: scripts/test.sh [ctest options]; the slow studies run only when asked for: scripts/test.sh -L slow
. "$(dirname "$0")/common.sh"

case "${1:-}" in -h|--help) sed -n '2,3p' "$0" | cut -c3-; exit 0 ;; esac
"$root/scripts/setup.sh" --with-tests
export OMNIFLEET_DATA="${OMNIFLEET_DATA:-$root/../shared/data}"
log="$build/Testing/test.log"
mkdir -p "$(dirname "$log")"
status=0
case " $* " in *" -L "*) which=() ;; *) which=(-LE slow) ;; esac
ctest --test-dir "$build" --output-on-failure -j 2 "${which[@]}" "$@" | tee "$log" || status=$?

skipped=$(grep -cE '\*\*\*Skipped' "$log" || true)
if [ "$skipped" -gt 0 ]; then
  echo
  echo "Skipped $skipped tests, because their input is not on this machine (set OMNIFLEET_DATA to the folder with other people's data):"
  grep -E '\*\*\*Skipped' "$log" | sed -E 's/.*Test +#[0-9]+: ([^ ]+).*/  \1/'
fi
echo
grep -E 'tests passed|tests failed|Total Test time' "$log" | tail -n 2
exit "$status"
