#!/bin/sh
# Runs a program, and what it starts, on one core, which no other program that is run so has.
set -eu
allowed=$(sed -n 's/^Cpus_allowed_list:[[:space:]]*//p' /proc/self/status)
cores=$(echo "$allowed" | tr ',' '\n' | while IFS=- read -r first last; do seq "$first" "${last:-$first}"; done)
for core in $cores; do
  exec 9>"${TMPDIR:-/tmp}/stillmap-test-core-$core-of-$(id -u)"
  if flock --nonblock 9; then
    exec taskset --cpu-list "$core" "$@"
  fi
done
exec taskset --cpu-list "${cores%%[!0-9]*}" "$@"
