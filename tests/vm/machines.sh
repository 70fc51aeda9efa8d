#!/bin/bash
# machines.sh COMMAND [ARG...] [-- COMMAND [ARG...]]...: runs each command in a machine of vmrun.sh, all at once, each on a
# CPU of its own. Fails if one of them fails; shows the output of one after the other.
set -u
folder=$(dirname "$0") cpus=$(nproc)
outputs=$(mktemp -d)
trap 'rm -rf "$outputs"' EXIT
machines=() words=()
start() {
  local machine=${#machines[@]}
  "$folder/vmrun.sh" -n -c $((machine % cpus)) -t 1800 -m 1024 -- "${words[@]}" > "$outputs/$machine" 2>&1 &
  machines+=($!) words=()
}
for word in "$@"; do
  if [ "$word" = -- ]; then start; else words+=("$word"); fi
done
start
code=0
for machine in "${!machines[@]}"; do
  wait "${machines[machine]}" || code=1
  cat "$outputs/$machine"
done
exit $code
