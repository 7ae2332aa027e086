# Sourced by the other scripts; not to be run.
set -euo pipefail
root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
build="${OMNIFLEET_BUILD_DIR:-$root/build/release}"
bin="$build/bin"

# Pictures and what is made of them lie in memory that is asked for in large pages, where the kernel gives them when
# asked: the local mapper takes some 7 % less time.
export GLIBC_TUNABLES="${GLIBC_TUNABLES-glibc.malloc.hugetlb=1}"

say() { printf '%s\n' "$*" >&2; }

need_build() {
  if [ ! -x "$bin/omnifleet_launch" ]; then
    say "omnifleet is not built yet: run scripts/setup.sh first"
    exit 1
  fi
}

# The shell is replaced by the program, so that Ctrl-C and exit codes are the program's own.
run() {
  need_build
  local program="$1"
  shift
  exec "$bin/$program" "$@"
}
