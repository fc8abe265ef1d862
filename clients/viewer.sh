#!/usr/bin/env bash
# A browser's view of a drive: a server, a replay that publishes the scans of a simulated city as a lidar
# would, and the gateway. Prints the page's address, and runs until it is stopped. The city is the demo's where
# that was run, else one for a lidar of 16 beams, which is made in a moment.
#
# BUILD                 build folder (build/release)
# STILLMAP_DEMO_DIR     where the sequence lies (./demo)
# STILLMAP_DEMO_SCANS   length of the sequence (300)
# STILLMAP_VIEWER_DATA  another sequence or bag to replay
# STILLMAP_LISTEN       address and port of the page (127.0.0.1:8765)
set -euo pipefail

bin=${BUILD:-build/release}/bin
demo=${STILLMAP_DEMO_DIR:-demo}
scans=${STILLMAP_DEMO_SCANS:-300}
data=${STILLMAP_VIEWER_DATA:-$demo/city_$scans}
[ -n "${STILLMAP_VIEWER_DATA:-}" ] || [ -f "$data/complete" ] || data=$demo/view_$scans
children=()

stop_children() {
  for pid in "${children[@]}"; do kill "$pid" 2>/dev/null || true; done
  wait 2>/dev/null || true
}
trap stop_children EXIT
trap 'exit 0' INT TERM

# A domain whose discovery port (7400 + 250 * domain) nobody on this machine has open.
free_domain() {
  local domain port
  for domain in $(seq 60 99 | shuf); do
    printf -v port '%04X' $((7400 + 250 * domain))
    grep -qi ":$port " /proc/net/udp || { echo "$domain"; return; }
  done
  return 1
}

for program in stillmap stillmap-server stillmap-gateway; do
  [ -x "$bin/$program" ] || { echo "viewer: $bin/$program is missing: run 'make viewer'" >&2; exit 1; }
done
mkdir -p "$demo"
domain=${ROS_DOMAIN_ID:-$(free_domain)}
# The page opens before the first scan: nothing waits for anything.
"$bin/stillmap-gateway" --domain "$domain" --listen "${STILLMAP_LISTEN:-127.0.0.1:8765}" &
children+=("$!")
"$bin/stillmap-server" --domain "$domain" > "$demo/viewer_server.log" 2>&1 &
children+=("$!")
if [ -z "${STILLMAP_VIEWER_DATA:-}" ] && [ ! -f "$data/complete" ]; then
  rm -rf "$data"
  "$bin/stillmap" simulate "$data" --preset quiet --sensor vlp_16 --scans "$scans" --seed 1
  touch "$data/complete"
fi
"$bin/stillmap" replay "$data" --domain "$domain" --timeout 60 > "$demo/viewer_replay.log" 2>&1 &
children+=("$!")
# Ends when the gateway does, as where its port is taken.
wait "${children[0]}"
