#!/usr/bin/env bash
# Installs missing Debian packages and builds the release. Idempotent.
# usage: scripts/setup.sh [--no-install] [--with-tests]
. "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"

install=1
targets=(programs)
for argument in "$@"; do
  case "$argument" in
    --no-install) install=0 ;;
    --with-tests) targets=(all) ;;
    -h|--help) sed -n '2,3p' "$0" | cut -c3-; exit 0 ;;
    *) say "setup.sh: unknown option $argument"; exit 2 ;;
  esac
done

missing_packages() {
  local package
  while read -r package; do
    dpkg-query -W -f '${Status}\n' "$package" 2>/dev/null | grep -q 'ok installed' || echo "$package"
  done < "$root/scripts/packages.txt"
}

if [ "$install" = 1 ]; then
  mapfile -t missing < <(missing_packages)
  if [ "${#missing[@]}" -gt 0 ]; then
    as_root=()
    if [ "$(id -u)" != 0 ]; then
      command -v sudo >/dev/null || { say "setup.sh: run as root or install sudo; missing: ${missing[*]}"; exit 1; }
      as_root=(sudo)
    fi
    say "installing ${#missing[@]} packages: ${missing[*]}"
    "${as_root[@]}" apt-get update -qq
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
  fi
fi

# CGAL needs 1.2 GB for one file: limits the number of jobs by the available memory.
memory_gb=$(awk '/MemAvailable/ {print int($2 / 1048576)}' /proc/meminfo)
jobs=$(nproc)
[ "$jobs" -gt $((memory_gb / 2)) ] && jobs=$((memory_gb / 2))
[ "$jobs" -lt 1 ] && jobs=1

say "building with $jobs jobs into $build"
cmake -S "$root" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release >/dev/null
cmake --build "$build" --target "${targets[@]}" -j "$jobs"
say "ready: scripts/demo.sh, scripts/replay.sh, scripts/launch.sh, scripts/evaluate.sh"
