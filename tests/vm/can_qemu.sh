#!/usr/bin/env bash
# The loop over SocketCAN in machines that qemu emulates (downloads a kernel of 70 MB the first time):
#   time that counts instructions: a minute at 1 kHz and 3 s at 10 kHz, not one sample lost
#   AddressSanitizer with UndefinedBehaviorSanitizer, and ThreadSanitizer: nothing to report
# Usage: can_qemu.sh [release|sanitize|tsan]...   Builds in build/qemu-*, for a processor without AVX-512.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
[ $# -gt 0 ] || set -- release sanitize tsan

build() {  # NAME SANITIZERS
  cmake -S . -B "build/qemu-$1" -G Ninja -DCMAKE_BUILD_TYPE=RelWithDebInfo -DSTAGEID_BUILD_TESTS=ON \
    -DSTAGEID_ARCHITECTURE=x86-64-v3 "-DSTAGEID_SANITIZE=$2" > /dev/null
  cmake --build "build/qemu-$1" --target can_loop --parallel "${JOBS:-$(nproc)}" > "build/qemu-$1/log" ||
    { tail -20 "build/qemu-$1/log" >&2; exit 1; }
}

for kind in "$@"; do
  echo "== $kind"
  loop=$PWD/build/qemu-$kind/tests/vm/can_loop
  case $kind in
    release)
      build release ""
      for case in "1000 60" "10000 3"; do
        # shellcheck disable=SC2086
        VMRUN_QEMU="-icount shift=1,sleep=off" tests/vm/vmrun.sh -b qemu -t 600 -x "$loop" -- \
          "$loop" vcan0 $case process
      done ;;
    sanitize)
      build sanitize address,undefined
      tests/vm/vmrun.sh -b qemu -m 1024 -t 300 -x "$loop" -- "$loop" vcan0 200 3 thread ;;
    tsan)
      build tsan thread
      tests/vm/vmrun.sh -b qemu -m 1024 -t 300 -x "$loop" -- "$loop" vcan0 200 3 thread ;;
    *) echo "can_qemu.sh: $kind: write release, sanitize or tsan" >&2; exit 64 ;;
  esac
done
