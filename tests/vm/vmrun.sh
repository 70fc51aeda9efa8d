#!/bin/bash
# vmrun.sh - run a command under a Linux kernel that has SocketCAN, on a host whose kernel has none.
#
#   vmrun.sh [-b uml|qemu] [-t SECONDS] [-m MiB] [-i IF[,IF...]] [-s DIR]... [-x BINARY]... [-c CPU] [-v] [-k] -- COMMAND [ARG...]
#
#   -b  uml   user-mode-linux; the host's file tree, read-only, is its root (default: nothing has to be copied)
#       qemu  qemu-system-x86_64 (TCG), Debian's linux-image, an initramfs with the -x programs and their libraries
#   -x  dynamically linked program to put into the initramfs, at its own path and in /usr/local/bin (qemu; uml ignores it)
#   -s  host directory that the command may write, at the same path inside (uml: hostfs; qemu: 9p)
#   -i  CAN FD interfaces to create (default vcan0), each with mtu 72
#   -t  seconds until the machine is killed (default 120)        -c  CPU to pin the machine to (default: the last one)
#   -v  say what happens, show the console                       -k  keep the temporary directory     -n  install nothing
# Result: COMMAND's exit code; 124 time-out; 125 the machine never reported a code (panic, boot failure, missing package).
# COMMAND's output (stdout and stderr together) goes to stdout as it comes.
# Environment: VMRUN_CACHE; for qemu VMRUN_QEMU (further arguments), VMRUN_ACCEL, VMRUN_SMP, VMRUN_CPUS, VMRUN_APPEND, VMRUN_MODS.
set -u
usage() { sed -n '2,18p' "$0" >&2; exit 64; }
back=uml; limit=120; mem=512; ifs=vcan0; shares=(); bins=(); verbose=0; keep=0; cpu=$(( $(nproc) - 1 )); install=1
while getopts b:t:m:i:s:x:c:vkn o; do case $o in b) back=$OPTARG;; t) limit=$OPTARG;; m) mem=$OPTARG;; i) ifs=$OPTARG;; s) shares+=("$(realpath "$OPTARG")");;
  x) bins+=("$OPTARG");; c) cpu=$OPTARG;; v) verbose=1;; k) keep=1;; n) install=0;; *) usage;; esac; done
shift $((OPTIND-1)); [ $# -gt 0 ] || usage
say() { [ $verbose = 0 ] || echo "vmrun: $*" >&2; }
fail() { echo "vmrun: $*" >&2; exit 125; }
cache=${VMRUN_CACHE:-${XDG_CACHE_HOME:-$HOME/.cache}/vmrun}; mkdir -p "$cache"
work=$(mktemp -d "${TMPDIR:-/tmp}/vmrun.XXXXXX"); mkdir "$work/io"; : >"$work/io/out"; : >"$work/console"; pid=; tailpid=
cleanup() { [ -z "$pid" ] || kill -9 -- "-$pid" 2>/dev/null; [ -z "$tailpid" ] || kill "$tailpid" 2>/dev/null; if [ $keep = 1 ]; then echo "vmrun: kept $work" >&2; else rm -rf "$work"; fi; }
trap cleanup EXIT; trap 'exit 130' INT TERM
need() { local p miss=(); for p in "$@"; do dpkg-query -W -f='${Status}' "$p" 2>/dev/null | grep -q 'ok installed' || miss+=("$p"); done
  [ ${#miss[@]} = 0 ] && return; [ $install = 1 ] || fail "missing packages: ${miss[*]}"
  { apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get -o DPkg::Lock::Timeout=300 install -y -qq --no-install-recommends "${miss[@]}"; } >"$cache/apt.log" 2>&1 || fail "apt-get install ${miss[*]}: $(tail -1 "$cache/apt.log")"; }

token=VMRUN-$$-$RANDOM; quoted=$(printf '%q ' "$@") # %q: what sh -c gets is what was given here
init_head() { cat <<'G'
#!/bin/busybox sh
BB=/bin/busybox
export PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin HOME=/tmp LANG=C.UTF-8 VMRUN=1
$BB mount -t proc proc /proc; $BB mount -t sysfs sys /sys; $BB mount -t devtmpfs dev /dev 2>/dev/null
[ -d /m ] || for d in /tmp /run /var/tmp; do $BB mount -t tmpfs tmpfs $d; done
$BB mkdir -p /dev/shm /dev/pts; $BB mount -t tmpfs tmpfs /dev/shm; $BB mount -t devpts devpts /dev/pts 2>/dev/null
$BB ln -sf /proc/self/fd /dev/fd; $BB ip link set lo up; $BB sysctl -qw kernel.sched_rt_runtime_us=-1 2>/dev/null
G
}
init_tail() { # $1: where the output goes
  local i; for i in ${ifs//,/ }; do echo "/sbin/ip link add dev $i type vcan && /sbin/ip link set dev $i mtu 72 txqueuelen 1000 up || echo '$token no-$i'"; done
  cat <<G
cd '$PWD' 2>/dev/null || cd /tmp
echo "$token begin \$(\$BB cut -d' ' -f1 /proc/uptime)"
/bin/sh -c ${quoted@Q} </dev/null >'$1' 2>&1
rc=\$?; \$BB sync; echo; echo "$token end \$rc \$(\$BB cut -d' ' -f1 /proc/uptime)"
\$BB poweroff -f
G
}

case $back in
uml)
  need user-mode-linux busybox-static iproute2 kmod
  K=$(ls -d /usr/lib/uml/modules/*/kernel | tail -1)
  { init_head; for m in net/can/can net/can/can-raw net/can/can-bcm net/can/can-gw drivers/net/can/dev/can-dev drivers/net/can/vcan drivers/net/can/vxcan; do echo "/sbin/insmod $K/$m.ko"; done
    case $PWD/ in /tmp/*|/run/*|/var/tmp/*) echo "\$BB mkdir -p '$PWD'; \$BB mount -r -t hostfs -o '$PWD' hostfs '$PWD'";; esac # a tmpfs hides it
    for s in "$work/io" "${shares[@]}"; do echo "\$BB mkdir -p '$s' 2>/dev/null; \$BB mount -t hostfs -o '$s' hostfs '$s'"; done
    init_tail "$work/io/out"; } >"$work/init"; chmod +x "$work/init" # /tmp is still the host's when pid 1 opens this
  shim=$work/uml_xstate.so; cc -O2 -shared -fPIC -o "$shim" "$(dirname "$0")/uml_xstate.c" 2>>"$work/stderr" || fail "cannot compile uml_xstate.c"
  cmd=(taskset -c "$cpu" env "LD_PRELOAD=$shim" linux.uml "mem=${mem}M" "umid=$token" "uml_dir=$work" rootfstype=hostfs root=/dev/root rootflags=/ ro "init=$work/init" con0=fd:0,fd:1 con=null quiet loglevel=0)
  ;;
qemu)
  need qemu-system-x86 busybox-static iproute2 kmod cpio zstd python3-minimal
  newest() { ls -d "$cache"/linux-image-*/boot/vmlinuz-*-amd64 2>/dev/null | grep -v cloud | tail -1; }
  kv=$(newest); if [ -z "$kv" ]; then # unpacked, never installed: no initrd and no boot loader wanted
    name() { apt-cache depends linux-image-amd64 2>/dev/null | sed -n 's/.*Depends: \(linux-image-[0-9].*-amd64\)$/\1/p' | head -1; }
    p=$(name); [ -n "$p" ] || { apt-get update -qq; p=$(name); }; [ -n "$p" ] || fail "no linux-image-amd64"
    (cd "$cache" && apt-get download -qq "$p" 2>/dev/null && dpkg-deb -x "$p"_*.deb "$p" && rm -f "$p"_*.deb) || fail "cannot get $p"; kv=$(newest); fi
  root=${kv%/boot/*}; ver=${kv##*/vmlinuz-}; elf=$cache/vmlinux-$ver; [ -s "$root/lib/modules/$ver/modules.dep" ] || depmod -b "$root" "$ver"
  [ -s "$elf" ] || { python3 - "$kv" "$elf.new" <<'P' && mv "$elf.new" "$elf"; } # unpacked kernel, PVH entry: no decompressor to emulate
import lzma, sys
b = open(sys.argv[1], 'rb').read(); out = lzma.LZMADecompressor().decompress(b[b.find(b'\xfd7zXZ\0'):])
assert out[:4] == b'\x7fELF'; open(sys.argv[2], 'wb').write(out)
P
  [ -s "$elf" ] || elf=$kv
  r=$work/root; mkdir -p "$r"/{bin,sbin,usr/bin,usr/sbin,usr/local/bin,lib,lib64,proc,sys,dev,tmp,run,var/tmp,etc,m} "$r$PWD"
  cp /bin/busybox "$r/bin/busybox"; for a in $(/bin/busybox --list | grep -v -x -E 'sh|ash|bash|ip|busybox'); do ln -s busybox "$r/bin/$a"; done
  add() { local f real l; f=$(command -v "$1") || fail "no program $1"; f=$(realpath -s "$f"); real=$(realpath "$f"); mkdir -p "$r$(dirname "$f")"; rm -f "$r$f"; cp -L "$real" "$r$f"; [ "$f" = "/usr/local/bin/${f##*/}" ] || ln -sf "$f" "$r/usr/local/bin/${f##*/}"
    ldd "$real" 2>/dev/null | grep -oE '/[^ ]+' | while read -r l; do mkdir -p "$r$(dirname "$l")"; [ -e "$r$l" ] || cp -L "$l" "$r$l"; done; }
  add /bin/dash; ln -sf dash "$r/bin/sh" # busybox' own shell would prefer its applets
  add /sbin/ip; for b in "${bins[@]}"; do add "$b"; done
  case $1 in /bin/*|/usr/bin/*|[!/.]*) [ -e "$r/bin/${1##*/}" ] || [ -e "$r/usr/local/bin/${1##*/}" ] || add "$1";; *) [ ! -x "$1" ] || add "$1";; esac
  mods="can can-raw can-bcm can-gw can-isotp vcan vxcan virtio_pci virtio_console ${VMRUN_MODS:-}"; [ ${#shares[@]} = 0 ] || mods="$mods 9p 9pnet_virtio"
  order=$(for m in $mods; do modprobe -d "$root" -S "$ver" --show-depends "$m"; done | awk '/^insmod/ && !s[$2]++ {print $2}'); for f in $order; do cp "$f" "$r/m/"; done
  { init_head; for f in $order; do echo "\$BB insmod /m/${f##*/}"; done
    n=0; for s in "${shares[@]}"; do echo "\$BB mkdir -p '$s'; \$BB mount -t 9p -o trans=virtio,version=9p2000.L,msize=262144,cache=mmap share$n '$s'"; n=$((n+1)); done
    init_tail /dev/vport0p1; } >"$r/init"; chmod +x "$r/init"; (cd "$r" && find . | cpio -o -H newc --quiet | zstd -q -1 >"$work/initrd")
  dev=(-device virtio-serial-pci -chardev "file,id=out,path=$work/io/out" -device "virtserialport,chardev=out,name=out")
  n=0; for s in "${shares[@]}"; do dev+=(-fsdev "local,id=f$n,path=$s,security_model=none" -device "virtio-9p-pci,fsdev=f$n,mount_tag=share$n"); n=$((n+1)); done
  read -ra more <<<"${VMRUN_QEMU:-}"
  cmd=(taskset -c "${VMRUN_CPUS:-$cpu}" qemu-system-x86_64 -accel "${VMRUN_ACCEL:-tcg,thread=single}" -cpu max -smp "${VMRUN_SMP:-1}" -m "$mem" -nodefaults -no-user-config -display none -no-reboot -net none -kernel "$elf" -initrd "$work/initrd"
    -append "console=ttyS0 quiet loglevel=1 panic=-1 rdinit=/init mitigations=off nokaslr random.trust_cpu=on tsc=reliable no_timer_check ${VMRUN_APPEND:-}" -serial stdio -monitor none "${dev[@]}" ${more[@]+"${more[@]}"})
  ;;
*) usage;; esac

t0=$(date +%s%N); ms() { echo $(( ($(date +%s%N) - t0) / 1000000 )); }; say "${cmd[*]}"
setsid "${cmd[@]}" </dev/null >"$work/console" 2>"$work/stderr" & pid=$!; disown "$pid" # own session: the whole group can be killed
tail -c +1 -s 0.05 -f --pid="$pid" "$work/io/out" & tailpid=$!
rc=125; up=
while :; do
  [ -n "$up" ] || { up=$(grep -a -m1 "^$token begin" "$work/console") && say "up after $(ms) ms (its own clock: ${up##* } s)"; }
  if end=$(grep -a -m1 "^$token end" "$work/console"); then set -- $end; rc=$3; break; fi
  [ "$(ms)" -lt $((limit * 1000)) ] || { rc=124; echo "vmrun: killed after $limit s" >&2; break; }
  kill -0 "$pid" 2>/dev/null || { grep -a -q "^$token end" "$work/console" && continue; break; }
  sleep 0.03
done
[ $rc -ge 124 ] && [ $rc -le 125 ] || for _ in {1..60}; do kill -0 "$pid" 2>/dev/null || break; sleep 0.03; done
kill -9 -- "-$pid" 2>/dev/null; wait "$tailpid" 2>/dev/null; tailpid= # tail ends with the machine, having shown the rest
[ -n "$up" ] || [ $rc != 125 ] || tail -5 "$work/stderr" >&2
[ $rc != 125 ] || { echo "vmrun: no exit code from the machine; its console ended with:" >&2; tail -c 1500 "$work/console" >&2; }
[ $verbose = 0 ] || grep -a -v "^$token" "$work/console" | tr -d '\r' | sed '/^$/d; s/^/console: /' >&2
say "$(ms) ms in all, exit code $rc"; exit "$rc"
