#!/usr/bin/env bash
# The whole product in separate processes that only share DDS: a replay publishes the lidar scans of
# a simulated city, stillmap-server segments and maps them, a planning client keeps the traversable
# area of the map and a path from the robot back to its start, others follow the poses and query
# regions of the map. Then poses, map and segmentation are compared with the truth.
# Every wait is for a condition. Its limit is long, so that the demo also passes on a busy machine.
#
# BUILD                build folder (build/release)
# STILLMAP_DEMO_DIR    where sequence and results go (./demo)
# STILLMAP_DEMO_SCANS  length of the sequence (300)
set -euo pipefail

bin=${BUILD:-build/release}/bin
demo=${STILLMAP_DEMO_DIR:-demo}
scans=${STILLMAP_DEMO_SCANS:-300}
config=$(dirname "$0")/../config/server/replay_lossless.yaml
city=$demo/city_$scans
out=$demo/result
query_size_m=50
max_ate_m=1.0
patience_s=300
patience=(--timeout "$patience_s")
children=()

fail() {
  echo "demo: FAILED: $*" >&2
  [ -f "$out/server.log" ] && tail -n 5 "$out/server.log" >&2
  exit 1
}

stop_children() {
  for pid in "${children[@]}"; do kill "$pid" 2>/dev/null || true; done
  wait 2>/dev/null || true
}
trap stop_children EXIT
trap 'exit 130' INT TERM

# wait_until WHAT COMMAND...: until the command succeeds; gives up after patience_s.
wait_until() {
  local what=$1 end=$((SECONDS + patience_s))
  shift
  until "$@"; do
    [ "$SECONDS" -lt "$end" ] || fail "waited $patience_s s for $what"
    sleep 0.5
  done
}

# A domain whose discovery port (7400 + 250 * domain) nobody on this machine has open.
free_domain() {
  local domain port
  for _ in {1..10}; do
    for domain in $(seq 60 99 | shuf); do
      printf -v port '%04X' $((7400 + 250 * domain))
      grep -qi ":$port " /proc/net/udp || { echo "$domain"; return; }
    done
    # For a second or so `stillmap doctor` listens to all domains at once.
    sleep 1
  done
  return 1
}

# value FILE KEY: a value of a JSON file with one key a line, as --json prints.
value() {
  # The outermost of that name.
  { sed -n "s/^  \"$2\": \"\{0,1\}\([^\",]*\)\"\{0,1\},\{0,1\}$/\1/p" "$1"
    sed -n "s/^ *\"$2\": \"\{0,1\}\([^\",]*\)\"\{0,1\},\{0,1\}$/\1/p" "$1"; } | sed -n 1p  # reads to the end: a reader that leaves early fails the pipe
}

# rounded FILE KEY DECIMALS
rounded() { printf "%.$3f" "$(value "$1" "$2")"; }

is_below() { awk -v a="$1" -v b="$2" 'BEGIN { exit !(a != "" && a + 0 < b + 0) }'; }

make_city() {
  [ -f "$city/complete" ] && return
  rm -rf "$city"
  "$bin/stillmap" simulate "$city" --preset quiet --scans "$scans" --seed 1
  touch "$city/complete"
}

start_server() {
  "$bin/stillmap-server" --config "$config" --domain "$domain" \
    --map-file "$out/map.stillmap" > "$out/server.log" 2>&1 &
  server=$!
  children+=("$server")
  wait_until "an answer of the server" server_answers
}

server_answers() {
  kill -0 "$server" 2>/dev/null || fail "the server ended too early"
  "$bin/stillmap" status --domain "$domain" --timeout 10 > /dev/null 2>&1
}

# One process plans the path home and plans again when the map requires it, a second one follows the
# poses, and a loop queries the surroundings of the robot.
start_clients() {
  "$bin/stillmap" plan --domain "$domain" --to 0,0 --profile car --follow --json --time-limit 30 "${patience[@]}" \
    --output "$out/path.json" --picture "$out/path.png" > "$out/plan.jsonl" 2> "$out/plan.log" &
  planner=$!
  children+=("$planner")
  "$bin/stillmap" watch --domain "$domain" --json "${patience[@]}" --out "$out/watched.tum" \
    > "$out/watch.jsonl" 2> "$out/watch.log" &
  watch=$!
  children+=("$watch")
  while [ ! -e "$out/replayed" ]; do
    "$bin/stillmap" query --domain "$domain" --around-robot "$query_size_m" --json --timeout 60 \
      >> "$out/queries_while_mapping.json" 2>> "$out/queries.log" || true
    sleep 1
  done &
  asker=$!
  children+=("$asker")
}

# The newest plan is a path. The planner may still be working through the last changes of the map.
has_path_home() {
  kill -0 "$planner" 2>/dev/null || fail "the planning client ended too early: $(cat "$out/plan.log")"
  tail -n 1 "$out/plan.jsonl" | grep -q '"status":"found"'
}

stop_clients() {
  touch "$out/replayed"
  wait "$asker"
  wait_until "a path home" has_path_home
  kill "$watch" || fail "the client that follows ended too early: $(cat "$out/watch.log")"
  wait "$watch" || fail "the client that follows ended with an error: $(cat "$out/watch.log")"
  kill "$planner" || fail "the planning client ended too early: $(cat "$out/plan.log")"
  wait "$planner" ||
    fail "the planning client has no path home: $(cat "$out/plan.log"; tail -n 1 "$out/plan.jsonl")"
}

stop_server() {
  kill "$server"
  wait "$server" || fail "the server did not stop in order (exit code $?)"
  children=()
}

check() {
  local mapped dropped watched
  mapped=$(value "$out/replay.json" mapped)
  dropped=$(value "$out/replay.json" dropped)
  [ "$mapped" = "$scans" ] || fail "$mapped of $scans scans were mapped"
  [ "$dropped" = 0 ] || fail "$dropped scans were dropped"
  watched=$(grep -vc '^#' "$out/watched.tum" || true)
  [ "$watched" -ge $((scans / 2)) ] || fail "the client that follows got $watched of $scans poses"
  grep -q '"road"' "$out/queries_while_mapping.json" || fail "no query returned a road while the server was mapping"
  grep -q '"road"' "$out/query.json" || fail "the last query returned no road"
  is_below "$(value "$out/accuracy.json" ate_rmse_m)" "$max_ate_m" ||
    fail "pose error (ATE) is $(value "$out/accuracy.json" ate_rmse_m) m, wanted is below $max_ate_m m"
  for file in map.stillmap query.ply segmentation.png map.png path.json path.png trajectory.png trajectory_error.png; do
    [ -s "$out/$file" ] || fail "$out/$file was not written"
  done
}

summary() {
  local answers plans
  plans=$(grep -c '"status":"found"' "$out/plan.jsonl")
  answers=$(grep -c '"map_version"' "$out/queries_while_mapping.json")
  cat <<TEXT

Stillmap demo: a simulated city, its clients and its server over DDS domain $domain
  scans         $(value "$out/replay.json" published) sent, $(value "$out/replay.json" mapped) mapped, $(value "$out/replay.json" dropped) dropped, in $(rounded "$out/replay.json" seconds 1) s
  segmentation  $(awk "BEGIN { printf \"%.1f\", 100 * $(value "$out/segmentation.json" accuracy) }") % of the points right, by the network alone
  pose error    ATE $(rounded "$out/accuracy.json" ate_rmse_m 3) m over $(rounded "$out/accuracy.json" path_m 1) m
  map           $(value "$out/status.json" voxels) voxels in $(value "$out/status.json" tiles) tiles, $(du -h "$out/map.stillmap" | cut -f1) on disk
  while mapping $(grep -vc '^#' "$out/watched.tum") poses followed, $answers region queries answered
  path home     planned $plans times while the map grew; now $(rounded "$out/path.json" length_m 1) m, clearance $(rounded "$out/path.json" clearance_m 1) m, in $(rounded "$out/path.json" plan_ms 0) ms
  at the end    $(value "$out/query.json" voxels) voxels within $query_size_m m in $(rounded "$out/query.json" ms 1) ms
  look at       $out/map.png (map, path, queried region), $out/path.png (traversability, path home), $out/segmentation.png (truth, found), $out/trajectory.png, $out/trajectory_error.png
  also          $out/map.stillmap $out/query.ply $out/poses_lidar.txt $out/server.log
TEXT
}

for program in stillmap stillmap-server; do
  [ -x "$bin/$program" ] || fail "$bin/$program is missing: run 'make build', or set BUILD"
done
rm -rf "$out"
mkdir -p "$out"
domain=$(free_domain) || fail "no free DDS domain between 60 and 99"

make_city
start_server
start_clients
"$bin/stillmap" replay "$city" --domain "$domain" --no-labels --lossless "${patience[@]}" \
  --out "$out/poses_lidar.txt" --json > "$out/replay.json" || fail "the replay ended with exit code $?"
"$bin/stillmap" query --domain "$domain" --around-robot "$query_size_m" --json "${patience[@]}" \
  --out "$out/query.ply" --picture "$out/map.png" > "$out/query.json" || fail "the query failed"
"$bin/stillmap" status --domain "$domain" --json "${patience[@]}" > "$out/status.json"
stop_clients
stop_server
"$bin/stillmap" evaluate trajectory --truth "$city/poses.txt" --truth-calib "$city/calib.txt" \
  --estimate "$out/poses_lidar.txt" --pictures "$out" --json > "$out/accuracy.json"
"$bin/stillmap" evaluate segmentation --drive-votes off --truth "$city" --scans 20 --picture "$out/segmentation.png" \
  --json > "$out/segmentation.json" || fail "the segmentation could not be evaluated"
check
summary
