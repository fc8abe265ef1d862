#!/bin/sh
# `docker run IMAGE` is the server, `docker run IMAGE stillmap-gateway` the gateway, `docker run IMAGE replay
# /dataset` a command of stillmap, and `docker run IMAGE sh` a shell. ROS_DOMAIN_ID holds for all of them.
set -eu
case ${1-stillmap-server} in
  stillmap-server)
    [ $# -eq 0 ] || shift
    case " $* " in
      *" --config "* | *" --config="* | *" --check-config "*) set -- stillmap-server "$@" ;;
      *) set -- stillmap-server --config "${STILLMAP_CONFIG:-/etc/stillmap/server.yaml}" "$@" ;;
    esac
    ;;
  stillmap | stillmap-gateway | sh | bash | /*) ;;
  *) set -- stillmap "$@" ;;
esac
exec "$@"
