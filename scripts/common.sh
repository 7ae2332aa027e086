# Sourced by the other scripts; not a program.
set -euo pipefail
root="$(cd "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/.." && pwd)"
build="${OMNIFLEET_BUILD_DIR:-$root/build/release}"
bin="$build/bin"

# Images and intermediate images are in memory that the allocator requests in large pages, if the kernel
# supports it. This reduces the time of the local mapper by about 7 %.
export GLIBC_TUNABLES="${GLIBC_TUNABLES-glibc.malloc.hugetlb=1}"

say() { printf '%s\n' "$*" >&2; }

need_build() {
  if [ ! -x "$bin/omnifleet_launch" ]; then
    say "omnifleet is not built yet: run scripts/setup.sh first"
    exit 1
  fi
}

# exec replaces the shell, so that Ctrl-C and the exit code are those of the program.
run() {
  need_build
  local program="$1"
  shift
  exec "$bin/$program" "$@"
}
