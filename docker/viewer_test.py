#!/usr/bin/env python3
"""Looks at a gateway as a browser does: viewer_test.py PORT [--patience SECONDS]

The page with its script, no answer to the names of others, and over WebSocket, from the server behind it, a
robot that moves and the tiles of its map. Prints a line for each, and how long after its own start it came;
exit code 1 and a reason where one does not come.
"""
import argparse
import base64
import http.client
import json
import os
import re
import socket
import struct
import time

BINARY, CLOSE, PING, PONG, TEXT = 2, 8, 9, 10, 1
ROBOT_MOVED_M = 1.0


class Missing(Exception):
    pass


def get(port, path, host="localhost"):
    """Status and body."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    try:
        connection.request("GET", path, headers={"Host": host})
        response = connection.getresponse()
        return response.status, response.read()
    finally:
        connection.close()


def eventually(what, deadline, look):
    """The first value of `look` that is true; a container's port is open before there is a program behind it."""
    reason = ""
    while time.monotonic() < deadline:
        try:
            found = look()
            if found:
                return found
        except (OSError, http.client.HTTPException) as error:
            reason = f": {error}"
        time.sleep(0.1)
    raise Missing(f"{what} did not come{reason}")


class Viewer:
    """A client of the Foxglove protocol that reads two topics."""

    def __init__(self, port, deadline):
        self.deadline = deadline
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=max(1, deadline - time.monotonic()))
        key = base64.b64encode(os.urandom(16)).decode()
        self.socket.sendall((f"GET / HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                             f"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {key}\r\n"
                             f"Sec-WebSocket-Protocol: foxglove.websocket.v1\r\n\r\n").encode())
        self.stream = self.socket.makefile("rb")
        status = self.stream.readline()
        if b" 101 " not in status:
            raise Missing(f"the WebSocket was refused: {status!r}")
        while self.stream.readline() != b"\r\n":
            pass

    def send(self, opcode, payload):
        """One masked frame, as clients send them; a mask of zeros leaves the bytes as they are."""
        length = (struct.pack("!B", 0x80 | len(payload)) if len(payload) < 126
                  else struct.pack("!BH", 0x80 | 126, len(payload)))
        self.socket.sendall(bytes([0x80 | opcode]) + length + bytes(4) + payload)

    def messages(self):
        """(opcode, bytes) of the whole messages that come until the deadline."""
        parts, kind = [], None
        while time.monotonic() < self.deadline:
            try:
                head = self.stream.read(2)
            except TimeoutError:
                return
            if len(head) < 2:
                raise Missing("the gateway closed the connection")
            opcode, length = head[0] & 0x0f, head[1] & 0x7f
            if length >= 126:
                length = int.from_bytes(self.stream.read(2 if length == 126 else 8), "big")
            payload = self.stream.read(length)
            if opcode in (CLOSE, PING, PONG):
                if opcode == PING:
                    self.send(PONG, payload)
                continue
            kind = opcode or kind
            parts.append(payload)
            if head[0] & 0x80:
                yield kind, b"".join(parts)
                parts = []

    def watch(self, wanted):
        """(topic, CDR) of these topics, as soon as the gateway has them."""
        subscriptions = {}
        for kind, message in self.messages():
            if kind == BINARY and message[0] == 1:
                yield subscriptions[struct.unpack_from("<I", message, 1)[0]], message[13:]
            elif kind == TEXT:
                for channel in json.loads(message).get("channels", []):
                    if channel["topic"] in wanted:
                        subscriptions[len(subscriptions)] = channel["topic"]
                        self.send(TEXT, json.dumps({"op": "subscribe", "subscriptions": [
                            {"id": len(subscriptions) - 1, "channelId": channel["id"]}]}).encode())


def position(odometry):
    """x, y [m] of a nav_msgs/Odometry in CDR, little endian: header, the child's frame, the pose."""
    at = 4 + 8
    for _ in ("frame_id", "child_frame_id"):
        at += -(at - 4) % 4
        at += 4 + struct.unpack_from("<I", odometry, at)[0]
    at += -(at - 4) % 8
    return struct.unpack_from("<2d", odometry, at)


def tile_path(tile_info):
    """Where the page fetches a tile; None of a tile that is gone. A stillmap_msgs/TileInfo in CDR."""
    x, y, _, _, _, _, _, _, content_hash = struct.unpack_from("<iiB7xQQddQQ", tile_info, 4)
    voxels, = struct.unpack_from("<I", tile_info, 4 + 64 + 24)
    return (f"/tiles/{x}/{y}/{content_hash:x}", voxels) if voxels else None


def look_at_page(port, deadline, report):
    page = eventually("the page", deadline, lambda: get(port, "/")[1].decode())
    script = re.search(r"main-[0-9A-Z]{8}\.js", page)
    if not script:
        raise Missing(f"the page names no script: {page[:200]!r}")
    status, body = get(port, "/" + script[0])
    if status != 200 or len(body) < 100_000:
        raise Missing(f"/{script[0]}: status {status}, {len(body)} bytes")
    report(f"the page, with a script of {len(body) / 1e3:.0f} kB")
    status, _ = get(port, "/", host="evil.example")
    if status != 403:
        raise Missing(f"as evil.example the page comes with status {status}, not 403")
    report("no page under another machine's name")


def look_at_drive(port, deadline, report):
    start, moved, tiles = None, False, 0
    for topic, cdr in Viewer(port, deadline).watch({"/stillmap/odometry", "/stillmap/tile_index"}):
        if topic == "/stillmap/odometry" and not moved:
            here = position(cdr)
            if start is None:
                start = here
                report("the first pose")
            moved = max(abs(a - b) for a, b in zip(here, start)) > ROBOT_MOVED_M
            if moved:
                report(f"the robot moved {ROBOT_MOVED_M:.0f} m")
        if topic == "/stillmap/tile_index" and not tiles and (tile := tile_path(cdr)):
            status, body = get(port, tile[0])
            # The map may have grown since.
            tiles = struct.unpack_from("<I", body, 12)[0] if status == 200 else 0
            if tiles:
                report(f"a tile of {tiles} voxels")
        if moved and tiles:
            return
    raise Missing("no robot that moves" if not moved else "no tile")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("port", type=int)
    parser.add_argument("--patience", type=float, default=120, help="longest wait for all of it [s]")
    arguments = parser.parse_args()
    began = time.monotonic()
    deadline = began + arguments.patience

    def report(what):
        print(f"{time.monotonic() - began:5.1f} s  {what}", flush=True)

    try:
        look_at_page(arguments.port, deadline, report)
        look_at_drive(arguments.port, deadline, report)
    except (Missing, OSError) as error:
        raise SystemExit(f"viewer test: {error}")


if __name__ == "__main__":
    main()
