#!/usr/bin/env bash
# Builds an image: build_image.sh [NAME] [--build-arg PACKAGES=given] [what else `docker build` takes]. npm's
# settings and the certificates of this machine go along while the page's packages are fetched; neither stays
# in the image.
#
# DOCKER   client with BuildKit: 23 or later with the buildx plugin, or older (docker)
set -euo pipefail
cd "$(dirname "$0")/.."

secrets=()
add_secret() { # add_secret NAME FILE
  if [ -r "$2" ]; then secrets+=(--secret "id=$1,src=$2"); fi
}
add_secret npmrc "${NPM_CONFIG_USERCONFIG:-$HOME/.npmrc}"
add_secret certificates "${NODE_EXTRA_CA_CERTS:-/etc/ssl/certs/ca-certificates.crt}"
DOCKER_BUILDKIT=1 "${DOCKER:-docker}" build -f docker/Dockerfile "${secrets[@]}" -t "${1:-stillmap}" "${@:2}" .
