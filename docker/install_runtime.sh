#!/bin/sh
# Inside the image: installs server, command line and gateway from the folder of packages $1.
set -eu

# OpenCV's core asks for libglx0, whose package asks for Mesa's drivers with all of LLVM: 190 MB for
# windows that nobody opens here. An empty package takes their place.
empty=$(mktemp -d)
mkdir "$empty/DEBIAN"
cat > "$empty/DEBIAN/control" <<TEXT
Package: stillmap-no-display
Version: 1
Architecture: all
Maintainer: Stillmap contributors <stillmap@localhost>
Provides: libglx-mesa0
Description: takes the place of Mesa's drivers where there is no display
TEXT
dpkg-deb --build "$empty" "$empty.deb" > /dev/null

apt-get update
DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends \
  "$empty.deb" "$1"/stillmap-data_*.deb "$1"/stillmap-server_*.deb "$1"/stillmap_*.deb

useradd --uid 10001 --user-group --no-create-home --home-dir /maps stillmap
# A named volume takes owner and rights from here.
install -d -o stillmap -g stillmap /maps /dataset /results
rm -rf "$empty" "$empty.deb" /var/lib/apt/lists/* /var/cache/apt/* /var/cache/debconf/* /var/log/* \
  /usr/share/doc/*/README* /usr/share/doc/*/changelog* /usr/share/man/* /usr/share/locale/*
