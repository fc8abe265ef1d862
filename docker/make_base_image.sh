#!/usr/bin/env bash
# Makes an image debian:bookworm-slim with debootstrap, where no registry can be reached.
#
# DEBIAN_MIRROR   where packages come from (else the first of this machine's own sources)
set -euo pipefail

image=${1:-debian:bookworm-slim}
docker=${DOCKER:-docker}
[ "$(id -u)" = 0 ] || { echo "make_base_image: debootstrap needs root" >&2; exit 1; }
command -v debootstrap > /dev/null ||
  { echo "make_base_image: debootstrap is missing: apt-get install debootstrap" >&2; exit 1; }

# Either place of them may be missing, and both may name none.
mirror=${DEBIAN_MIRROR:-$({ cat /etc/apt/sources.list /etc/apt/sources.list.d/* 2> /dev/null || true; } |
  { grep -oE 'https?://[^ ]+/debian/?( |$)' || true; } | head -n 1 | tr -d ' ')}
root=$(mktemp -d)
trap 'rm -rf "$root"' EXIT
debootstrap --variant=minbase bookworm "$root" "${mirror:-http://deb.debian.org/debian}" > "$root.log" ||
  { tail -n 5 "$root.log" >&2; exit 1; }
rm -f "$root.log"

# What the official slim image leaves out.
rm -rf "$root"/var/cache/apt/* "$root"/var/lib/apt/lists/* "$root"/usr/share/{man,locale,info,lintian}/* \
  "$root"/var/log/*
find "$root/usr/share/doc" -mindepth 2 ! -name copyright ! -type d -delete
printf 'path-exclude /usr/share/%s/*\n' man locale info > "$root/etc/dpkg/dpkg.cfg.d/slim"
cat >> "$root/etc/dpkg/dpkg.cfg.d/slim" <<TEXT
path-exclude /usr/share/doc/*
path-include /usr/share/doc/*/copyright
TEXT
tar -C "$root" --exclude=./dev/* -c . | "$docker" import --change 'CMD ["bash"]' - "$image" > /dev/null
echo "$image: $("$docker" image inspect -f '{{.Size}}' "$image" | awk '{ printf "%.0f MB", $1 / 1e6 }')"
