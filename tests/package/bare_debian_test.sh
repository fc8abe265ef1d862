#!/bin/sh
# Inside a bare Debian 12: installs the packages in $1, and lets them do what they are for.
set -eu
packages=$1
export ROS_DOMAIN_ID="${ROS_DOMAIN_ID:-55}"
cd "$(mktemp -d)"

check() { # check WHAT COMMAND...
  what=$1
  shift
  if ! "$@" > output 2>&1; then
    echo "package test: FAILED: $what:" >&2
    tail -n 20 output >&2
    exit 1
  fi
  echo "ok   packages: $what"
}
contains() { grep -q -e "$2" "$1"; }

apt-get update -q > /dev/null
check "install on a bare Debian" env DEBIAN_FRONTEND=noninteractive \
  apt-get install -yq --no-install-recommends "$packages"/*stillmap*.deb
check "keep their configuration as Debian does" sh -c \
  "dpkg-query -W -f '\${Conffiles}' stillmap-server | grep -q /etc/stillmap/server.yaml"
check "have every file that they say" dpkg -V stillmap-data stillmap-server stillmap
check "stillmap-server names its version" stillmap-server --version
check "/etc/stillmap/server.yaml can be used" stillmap-server --check-config /etc/stillmap/server.yaml
check "simulate" stillmap simulate city --preset yard --sensor vlp_16 --scans 20

stillmap-server --config /etc/stillmap/server.yaml --domain "$ROS_DOMAIN_ID" --delivery every \
  --map-file map.stillmap > server.log 2>&1 &
server=$!
check "a server that is alive" stillmap health --timeout 30
stillmap-gateway --domain "$ROS_DOMAIN_ID" --listen 127.0.0.1:0 > gateway.log 2>&1 &
gateway=$!
# Debian without anything has no client of HTTP but bash.
check "the page of stillmap-gateway" timeout 30 bash -c '
  until port=$(grep -oP "http://127.0.0.1:\K\d+" gateway.log); do kill -0 "$1" || { cat gateway.log; exit 1; }; sleep 0.1; done
  exec 3<> "/dev/tcp/127.0.0.1/$port"
  printf "GET / HTTP/1.0\r\nHost: localhost\r\n\r\n" >&3
  grep -qE "src=.*main-[0-9A-Z]{8}\.js" <&3' bash "$gateway"
kill "$gateway"
check "a replay through the server" stillmap replay city --lossless --timeout 30
check "every scan mapped" sh -c "stillmap status --json | grep -q '\"scans_mapped\": 20'"
kill "$server"
if ! wait "$server"; then
  echo "package test: FAILED: the server ended with an error:" >&2
  tail -n 5 server.log >&2
  exit 1
fi
echo "ok   packages: a server that stops in order"
check "its map on disk" stillmap map-check map.stillmap
check "a GeoTIFF" stillmap map-export map.stillmap -o map.tif --datum 48.1,11.5
mkdir pcd
check "a PCD file, written" stillmap map-export map.stillmap -o pcd/0.pcd
check "and read again" stillmap map pcd --sensor vlp_16 --out pcd_map

# Where it was built without Python's headers, there is no module.
if ls "$packages"/python3-stillmap*.deb > /dev/null 2>&1; then
  check "the Python module" python3 -c "import stillmap; assert len(stillmap.open_map('map.stillmap')) > 0"
  check "is removed alone" apt-get purge -yq python3-stillmap
fi

check "are removed without a trace of the programs" apt-get purge -yq stillmap stillmap-server stillmap-data
check "nothing of them left" sh -c "! ls /usr/bin/stillmap* /etc/stillmap /usr/share/stillmap 2> /dev/null | grep -q ."
