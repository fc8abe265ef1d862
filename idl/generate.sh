#!/bin/sh
# generate.sh FASTDDSGEN ARGUMENTS ...: runs fastddsgen, and prints what it says only where it fails.
# In a run of seconds, Java's optimising compiler costs more than it gains.
set -eu
log=$(mktemp)
trap 'rm -f "$log"' EXIT
if ! JAVA_TOOL_OPTIONS="-XX:TieredStopAtLevel=1 -XX:+UseSerialGC ${JAVA_TOOL_OPTIONS:-}" "$@" > "$log" 2>&1; then
  cat "$log" >&2
  exit 1
fi
