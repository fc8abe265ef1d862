#!/bin/sh
# Runs a program, and what it starts, on one core, which no other program that is run so has.
for core in $(seq 0 $(($(nproc --all) - 1))); do
  exec 9>"${TMPDIR:-/tmp}/stillmap-test-core-$core"
  if flock --nonblock 9; then
    exec taskset --cpu-list "$core" "$@"
  fi
done
exec taskset --cpu-list 0 "$@"
