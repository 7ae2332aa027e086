#!/usr/bin/env bash
# Installs and builds everything, runs all tests, prints the summary of ctest and the skipped tests.
# usage: scripts/test.sh [ctest options]; slow studies run only on request: scripts/test.sh -L slow
. "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"

usage() { sed -n '2,3p' "$0" | cut -c3-; }
# ctest ignores unknown options and stray words without a message.
needs_value=
for argument in "$@"; do
  if [ -n "$needs_value" ]; then
    needs_value=
    continue
  fi
  case "$argument" in
    -h|--help) usage; exit 0 ;;
    -C|-E|-FA|-FC|-FS|-I|-j|-L|-LE|-O|-R|--build-config|--exclude-regex|--fixture-exclude-any|--fixture-exclude-cleanup|\
    --fixture-exclude-setup|--label-exclude|--label-regex|--output-junit|--output-log|--parallel|--repeat|--repeat-until-fail|\
    --resource-spec-file|--stop-time|--test-load|--test-output-size-failed|--test-output-size-passed|\
    --test-output-truncation|--tests-information|--tests-regex|--timeout)
      needs_value="$argument" ;;
    -j[0-9]*|-N|-Q|-U|-V|-VV|--debug|--extra-verbose|--no-label-summary|--output-on-failure|--print-labels|--progress|\
    --quiet|--rerun-failed|--schedule-random|--show-only|--show-only=*|--stop-on-failure|--union|--verbose|--no-tests=*) ;;
    *) say "test.sh: unknown option $argument"; usage >&2; exit 2 ;;
  esac
done
[ -z "$needs_value" ] || { say "test.sh: $needs_value needs a value"; usage >&2; exit 2; }
"$root/scripts/setup.sh" --with-tests
export OMNIFLEET_DATA="${OMNIFLEET_DATA:-$root/../shared/data}"
log="$build/Testing/test.log"
mkdir -p "$(dirname "$log")"
status=0
case " $* " in *" -L "*|*" --label-regex "*) which=() ;; *) which=(-LE slow) ;; esac
ctest --test-dir "$build" --output-on-failure -j 2 "${which[@]}" "$@" | tee "$log" || status=$?

skipped=$(grep -cE '\*\*\*Skipped' "$log" || true)
if [ "$skipped" -gt 0 ]; then
  echo
  echo "Skipped $skipped tests, because their input is not on this machine (set OMNIFLEET_DATA to the folder with the external data):"
  grep -E '\*\*\*Skipped' "$log" | sed -E 's/.*Test +#[0-9]+: ([^ ]+).*/  \1/'
fi
echo
grep -E 'tests passed|tests failed|Total Test time' "$log" | tail -n 2
exit "$status"
