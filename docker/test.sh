#!/usr/bin/env bash
# Builds the image, and runs the deployments of docker/*.compose.yaml end to end: replay (map, path and
# pictures in a volume), fleet (discovery server, no multicast), robot (host's network, also with shared
# memory), viewer (the page, and what comes through the gateway). Starts dockerd, and makes the base image,
# where there is none; leaves neither.
#
# STILLMAP_PACKAGES   folder of .deb files (`make deb`) to build the image from, instead of the sources
# STILLMAP_TEST_SCANS length of the simulated sequences (40)
# KEEP_IMAGE          set: leave the image stillmap-test
set -euo pipefail
cd "$(dirname "$0")/.."

scans=${STILLMAP_TEST_SCANS:-40}
domain=54
# Of this machine, where a viewer of somebody else may be at the usual one.
viewer_port=$((20000 + RANDOM % 10000))
export STILLMAP_IMAGE=stillmap-test STILLMAP_SCANS=$scans DOCKER_BUILDKIT=1
max_mb=320
work=$(mktemp -d /tmp/stillmap_docker_test.XXXXXX)
started_dockerd=
made_base=
passed=0

fail() {
  echo "docker test: FAILED: $*" >&2
  exit 1
}

pass() {
  passed=$((passed + 1))
  echo "ok   $*"
}

# A client that can use BuildKit: with the buildx plugin, or older than 23.
find_docker() {
  local candidate
  for candidate in ${DOCKER:-docker /usr/bin/docker}; do
    command -v "$candidate" > /dev/null || continue
    if "$candidate" buildx version > /dev/null 2>&1 ||
      [ "$("$candidate" --version | sed -E 's/[^0-9]*([0-9]+).*/\1/')" -lt 23 ]; then
      echo "$candidate"
      return
    fi
  done
  return 1
}

compose() {
  if command -v docker-compose > /dev/null; then docker-compose "$@"; else "$docker" compose "$@"; fi
}

start_dockerd() {
  "$docker" info > /dev/null 2>&1 && return
  [ "$(id -u)" = 0 ] || fail "no Docker daemon answers; start it, or run this as root"
  command -v dockerd > /dev/null || fail "dockerd is missing: apt-get install docker.io docker-compose"
  dockerd --data-root "$work/data" > "$work/dockerd.log" 2>&1 &
  started_dockerd=$!
  for _ in $(seq 60); do
    "$docker" info > /dev/null 2>&1 && return
    sleep 1
  done
  tail -n 5 "$work/dockerd.log" >&2
  fail "dockerd does not start"
}

clean_up() {
  local status=$?
  trap - EXIT
  {
    compose -p stillmap_replay_test -f docker/replay.compose.yaml down -v -t 20
    compose -p stillmap_fleet_test -f docker/fleet.compose.yaml down -v -t 20
    compose -p stillmap_viewer_test -f docker/viewer.compose.yaml down -v -t 20
    stop_robot
    [ -n "${KEEP_IMAGE-}" ] || "$docker" rmi "$STILLMAP_IMAGE"
    [ -z "$made_base" ] || "$docker" rmi debian:bookworm-slim
    [ -z "$started_dockerd" ] || { kill "$started_dockerd"; wait "$started_dockerd"; }
  } > /dev/null 2>&1 || true
  [ -z "${made_packages-}" ] || rm -rf docker/packages
  rm -rf "$work"
  exit "$status"
}

make_base() {
  "$docker" image inspect debian:bookworm-slim > /dev/null 2>&1 && return
  timeout 60 "$docker" pull -q debian:bookworm-slim > /dev/null 2>&1 && return
  echo "no registry answers: making debian:bookworm-slim with debootstrap"
  DOCKER=$docker docker/make_base_image.sh
  made_base=yes
}

build_image() {
  local from=built
  if [ -n "${STILLMAP_PACKAGES-}" ]; then
    from=given
    [ ! -e docker/packages ] || fail "docker/packages is there: move it away, it would be taken for the test's"
    made_packages=yes
    mkdir -p docker/packages
    cp "$STILLMAP_PACKAGES"/*.deb docker/packages/
  fi
  # The host's network: a mirror that only the host reaches is reached.
  DOCKER=$docker docker/build_image.sh "$STILLMAP_IMAGE" -q --network host --build-arg PACKAGES=$from \
    --build-arg JOBS="${JOBS:-$(nproc)}" > /dev/null || fail "the image does not build"
}

in_image() { "$docker" run --rm --network none "$STILLMAP_IMAGE" "$@"; }

check_image() {
  local mb found
  mb=$("$docker" image inspect -f '{{.Size}}' "$STILLMAP_IMAGE" | awk '{ printf "%.0f", $1 / 1e6 }')
  [ "$mb" -lt "$max_mb" ] || fail "the image has $mb MB, wanted are less than $max_mb"
  pass "the image has $mb MB"
  found=$(in_image sh -c 'ls /usr/bin /usr/lib/*/ | grep -E "^(gcc|g\+\+|cc|ld|cmake|libvtk.*|libQt.*|libLLVM.*)$" || true')
  [ -z "$found" ] || fail "the image has $found"
  pass "no compilers, VTK, Qt or LLVM in it"
  [ "$(in_image sh -c 'id -u')" = 10001 ] || fail "the image runs as another user than 10001"
  pass "runs as user 10001"
  in_image stillmap-server --check-config /etc/stillmap/server.yaml > /dev/null ||
    fail "the image's configuration cannot be used"
  pass "its configuration and model can be used"
}

# The packages themselves, where they are given, on the bare base image.
test_packages() {
  [ -n "${STILLMAP_PACKAGES-}" ] || return 0
  "$docker" run --rm --network host --shm-size 256m -e ROS_DOMAIN_ID=55 -v "$(realpath "$STILLMAP_PACKAGES"):/packages:ro" \
    -v "$PWD/tests/package/bare_debian_test.sh:/test.sh:ro" debian:bookworm-slim sh /test.sh /packages ||
    fail "the packages do not do what they are for on a bare Debian"
}

container() { compose -p "$1" -f "docker/$2.compose.yaml" ps -q "$3" | head -n 1; }

test_replay() {
  local run=(compose -p stillmap_replay_test -f docker/replay.compose.yaml) server began seconds code
  "${run[@]}" run -T --rm results > "$work/results.log" 2>&1 ||
    { cat "$work/results.log" >&2; "${run[@]}" logs --tail 20 >&2; fail "the replay did not come to its results"; }
  pass "replay: $(tail -n 1 "$work/results.log" | tr -s ' \r\n' ' ')"
  server=$(container stillmap_replay_test replay server)
  [ "$("$docker" inspect -f '{{.State.Health.Status}}' "$server")" = healthy ] || fail "the server is not healthy"
  pass "replay: Docker finds the server healthy"
  "$docker" exec "$server" stillmap status --json > "$work/status.json"
  grep -qE "\"scans_mapped\": $scans\b" "$work/status.json" ||
    fail "not all of $scans scans were mapped: $(grep scans_ "$work/status.json")"
  pass "replay: $scans of $scans scans mapped"
  "${run[@]}" stop -t 20 planner > /dev/null 2>&1
  began=$(date +%s%N)
  "$docker" stop "$server" > /dev/null
  seconds=$(awk "BEGIN { printf \"%.1f\", ($(date +%s%N) - $began) / 1e9 }")
  code=$("$docker" inspect -f '{{.State.ExitCode}}' "$server")
  [ "$code" = 0 ] || fail "the server ended with $code after $seconds s instead of saving its map"
  pass "replay: the server saved its map and stopped in $seconds s"
  for file in map.stillmap poses_lidar.txt path.json path.png map.png around_robot.ply; do
    "${run[@]}" run -T --rm --no-deps results sh -c "[ -s /results/$file ]" > /dev/null 2>&1 ||
      fail "/results/$file was not written; the planner: $("${run[@]}" logs --tail 3 planner)"
  done
  pass "replay: map, poses, path and pictures are in the volume"
  "${run[@]}" run -T --rm --no-deps results map-check /results/map.stillmap > /dev/null 2>&1 ||
    fail "the map file in the volume is damaged"
  pass "replay: the map file is valid"
}

# Drops multicast on the ports of the bridge of network $1, and shows that it is gone.
stop_multicast() {
  local bridge port
  bridge=br-$("$docker" network inspect -f '{{.Id}}' "$1" | cut -c1-12)
  [ "$(id -u)" = 0 ] && command -v bridge > /dev/null || return 1
  ip link set dev "$bridge" type bridge mcast_snooping 0
  for port in $(bridge link show master "$bridge" 2> /dev/null | sed -E 's/^[0-9]+: ([^@:]+).*/\1/'); do
    bridge link set dev "$port" mcast_flood off
  done
}

test_fleet() {
  local run=(compose -p stillmap_fleet_test -f docker/fleet.compose.yaml) robot code planner found=0
  "${run[@]}" up -d --scale planner=3 > "$work/fleet.log" 2>&1 ||
    { cat "$work/fleet.log" >&2; "${run[@]}" logs --tail 20 >&2; fail "the fleet does not start"; }
  if stop_multicast stillmap_fleet_test_fleet; then pass "fleet: its bridge carries no multicast"; fi
  robot=$(container stillmap_fleet_test fleet robot)
  code=$(timeout 600 "$docker" wait "$robot")
  [ "$code" = 0 ] || { "${run[@]}" logs --tail 20 >&2; fail "the robot's replay ended with $code"; }
  "${run[@]}" run -T --rm tool status --json > "$work/fleet.json" 2> /dev/null || fail "nobody answers in the fleet"
  grep -qE "\"scans_mapped\": $scans\b" "$work/fleet.json" ||
    fail "not all of $scans scans were mapped: $(grep scans_ "$work/fleet.json")"
  pass "fleet: $scans of $scans scans mapped, found through the discovery server"
  for _ in $(seq 120); do
    found=0
    for planner in $("${run[@]}" ps -q planner); do
      "$docker" logs "$planner" > "$work/planner.log" 2> /dev/null
      if grep -q '"status":"found"' "$work/planner.log"; then found=$((found + 1)); fi
    done
    [ "$found" -lt 3 ] || break
    sleep 1
  done
  [ "$found" = 3 ] || { "${run[@]}" logs --tail 5 planner >&2; fail "$found of 3 planners have a path"; }
  pass "fleet: 3 of 3 planners planned a path home"
  if "${run[@]}" run -T --rm -e STILLMAP_DDS_PROFILE=/etc/stillmap/bridge.yaml -e STILLMAP_DISCOVERY_SERVER= \
    tool status --timeout 4 > /dev/null 2>&1; then
    fail "a client found the server by multicast: there is some in the fleet's network"
  fi
  pass "fleet: who looks for the server by multicast does not find it"
}

test_viewer() {
  local run=(compose -p stillmap_viewer_test -f docker/viewer.compose.yaml) up line gateway health
  export STILLMAP_PORT=$viewer_port
  "${run[@]}" up -d > "$work/viewer.log" 2>&1 &
  up=$!
  # Beside it, as the page opens before anything else is there. Its seconds begin with `up`.
  python3 docker/viewer_test.py "$viewer_port" > "$work/viewer_test.log" 2>&1 ||
    { cat "$work/viewer.log" "$work/viewer_test.log" >&2; "${run[@]}" logs --tail 20 >&2; fail "the viewer shows no drive"; }
  wait "$up" || { cat "$work/viewer.log" >&2; fail "the viewer does not start"; }
  while read -r line; do pass "viewer: after $line"; done < "$work/viewer_test.log"
  gateway=$(container stillmap_viewer_test viewer gateway)
  for _ in $(seq 20); do
    health=$("$docker" inspect -f '{{.State.Health.Status}}' "$gateway")
    [ "$health" = starting ] || break
    sleep 1
  done
  [ "$health" = healthy ] || fail "Docker finds the gateway $health"
  [ "$("$docker" port "$gateway")" = "8765/tcp -> 127.0.0.1:$viewer_port" ] ||
    fail "others reach the gateway's port: $("$docker" port "$gateway")"
  pass "viewer: Docker finds the gateway healthy, at this machine's port only"
  "${run[@]}" down -v -t 20 > /dev/null 2>&1
  unset STILLMAP_PORT
}

robot=(-p stillmap_robot_test -f docker/robot.compose.yaml)

stop_robot() {
  compose "${robot[@]}" down -v -t 20
  STILLMAP_USER=10001:10001 STILLMAP_MAPS=$work/maps compose "${robot[@]}" \
    -f docker/robot_shared_memory.compose.yaml down -v -t 20
}

ask_robot() {
  "$docker" run --rm --network host -e ROS_DOMAIN_ID=$domain "$@" "$STILLMAP_IMAGE" status --timeout 15 --json
}

test_robot() {
  export ROS_DOMAIN_ID=$domain
  compose "${robot[@]}" up -d > "$work/robot.log" 2>&1 || { cat "$work/robot.log" >&2; fail "the robot's server does not start"; }
  ask_robot > /dev/null || { compose "${robot[@]}" logs --tail 10 >&2; fail "the robot's server does not answer"; }
  pass "robot: answers in the host's network over UDP"
  compose "${robot[@]}" down -v -t 20 > /dev/null 2>&1
  export STILLMAP_USER=10001:10001 STILLMAP_MAPS=$work/maps
  install -d -m 777 "$work/maps"
  chmod 755 "$work"
  compose "${robot[@]}" -f docker/robot_shared_memory.compose.yaml up -d > "$work/robot.log" 2>&1 ||
    { cat "$work/robot.log" >&2; fail "the robot's server does not start with shared memory"; }
  ask_robot --ipc host --user 10001:10001 -e STILLMAP_DDS_PROFILE=lan > /dev/null ||
    fail "the robot's server does not answer over shared memory"
  pass "robot: answers over shared memory to the same user in the same /dev/shm"
  stop_robot > /dev/null 2>&1
  unset STILLMAP_USER STILLMAP_MAPS ROS_DOMAIN_ID
}

docker=$(find_docker) || fail "no docker client with BuildKit: apt-get install docker.io, or the buildx plugin"
command -v python3 > /dev/null || fail "python3 is missing: apt-get install python3-minimal"
command -v docker-compose > /dev/null || "$docker" compose version > /dev/null 2>&1 ||
  fail "docker-compose is missing: apt-get install docker-compose"
trap clean_up EXIT
trap 'exit 130' INT TERM
start_dockerd
make_base
test_packages
build_image
check_image
test_replay
test_viewer
test_robot
test_fleet
echo "docker test: $passed checks passed"
