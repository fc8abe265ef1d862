#!/usr/bin/env python3
"""Replays drives to a server that closes loops and to one that does not, and compares path and map.

  tests/loops/served.py --programs build/release/bin --results build/release/loops
  tests/loops/served.py ... --sequence /data/recordings/kitti_raw_0005 --sensor hdl_64e

A drive that is there is not simulated again. Prints a table for tests/README.md. Without true poses the
path is compared with that of the server that leaves loops open. Exit code 1 when closing loops makes the
path of a simulated drive worse by more than a centimetre.
"""
import argparse
import json
import math
import pathlib
import shutil
import signal
import sqlite3
import subprocess
import sys
import time

from loops import call, matrix, true_poses

# name, options of 'stillmap simulate', sensor, whether the true labels are sent, too
DRIVES = [
    ("quiet, 16 rings, seed 1, no labels", "--preset quiet --sensor vlp_16 --seed 1 --scans 1600", "vlp_16", False),
    ("quiet, 64 rings, seed 2, no labels", "--preset quiet --sensor hdl_64e --seed 2 --scans 1400", "hdl_64e", False),
    ("crowd, 16 rings, seed 4", "--preset crowd --sensor vlp_16 --seed 4 --scans 2600", "vlp_16", True),
]


def serve(arguments, sequence, sensor, has_labels, folder, closes):
    """The status of a server that was sent the drive; its map is in the folder then."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    (folder / "server.yaml").write_text(
        f"sensor: {sensor}\n"
        f"dds: {{domain_id: {arguments.domain}, interfaces: [127.0.0.1]}}\n"
        "input: {delivery: every}\nlabels: {source: stream}\n"
        f"map: {{file: map.stillmap, close_loops: {str(closes).lower()}}}\n")
    on_domain = ["--domain", arguments.domain, "--interface", "127.0.0.1"]
    with open(folder / "server.log", "wb") as log:
        server = subprocess.Popen([arguments.programs / "stillmap-server", "--config", folder / "server.yaml"],
                                  stderr=log)
    try:
        time.sleep(1)
        if server.poll() is not None:
            sys.exit(f"the server did not start:\n{(folder / 'server.log').read_text()}")
        replay = [arguments.programs / "stillmap", "replay", sequence, "--lossless", "--timeout", 60, *on_domain]
        call(replay + (["--rate", arguments.rate] if arguments.rate else [])
             + ([] if has_labels else ["--no-labels"]))
        # The search for loops may lag behind the mapping by some scans.
        time.sleep(5)
        status = json.loads(call([arguments.programs / "stillmap", "status", "--json", *on_domain]))
    finally:
        server.send_signal(signal.SIGTERM)
        server.wait(timeout=120)
    if server.returncode != 0:
        sys.exit(f"the server ended with {server.returncode}: see {folder / 'server.log'}")
    return status


def write_path(folder):
    with sqlite3.connect(folder / "map.stillmap") as database:
        poses = list(database.execute(
            "SELECT stamp_ns, x, y, z, qx, qy, qz, qw FROM trajectory ORDER BY position"))
    path = folder / "path.tum"
    path.write_text("".join(f"{stamp / 1e9:.9f} " + " ".join(map(str, pose)) + "\n" for stamp, *pose in poses))
    return path


def quaternion(pose):
    """x, y, z, w of a rotation by less than half a turn."""
    w = 0.5 * math.sqrt(max(1.0 + pose[0][0] + pose[1][1] + pose[2][2], 1e-12))
    return ((pose[2][1] - pose[1][2]) / (4 * w), (pose[0][2] - pose[2][0]) / (4 * w),
            (pose[1][0] - pose[0][1]) / (4 * w), w)


def true_path(sequence, folder):
    """With stamps: poses that were lost are no part of a path. None without true poses."""
    if (sequence / "poses.txt").exists():
        poses = true_poses(sequence)
    elif (sequence / "poses_lidar.txt").exists():
        poses = [matrix(line.split()) for line in (sequence / "poses_lidar.txt").read_text().splitlines()]
    else:
        return None
    stamps = (sequence / "times.txt").read_text().split()
    path = folder / "truth.tum"
    path.write_text("".join(
        f"{stamp} " + " ".join(str(value) for value in (*(row[3] for row in pose[:3]), *quaternion(pose))) + "\n"
        for stamp, pose in zip(stamps, poses)))
    return path


def row_of(arguments, sequence, folder, status, reference):
    path = write_path(folder)
    truth = true_path(sequence, folder) or reference or path
    errors = json.loads(call([arguments.programs / "stillmap", "evaluate", "trajectory", "--json",
                              "--estimate", path, "--truth", truth, "--max-difference", 0.001]))
    kept = "-"
    if (sequence / "labels").exists():
        found = json.loads(call([arguments.programs / "stillmap", "evaluate", "map", "--truth", sequence,
                                 "--map", folder / "map.stillmap", "--json"]))
        kept = f"{100 * found['preservation_rate']:.1f} %, {100 * found['rejection_rate']:.1f} %"
    counters = status["counters"]
    longest = {stage: f"{time['max_ms']:.0f}" for stage, time in status["latencies"].items()}
    return errors["ate_rmse_m"], (
        f"{errors['ate_rmse_m']:.3f}, {errors['ate_max_m']:.3f} | {status['voxels']:,} | {kept} | "
        f"{counters.get('loops_closed', 0)} | {counters.get('map_corrections', 0)} | {longest.get('correction', '-')} | {longest['pose']} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--programs", required=True, type=lambda text: pathlib.Path(text).resolve())
    parser.add_argument("--results", required=True, type=lambda text: pathlib.Path(text).resolve())
    parser.add_argument("--only", default="", help="drives with this in their name")
    parser.add_argument("--sequence", type=pathlib.Path, help="this one instead of the simulated ones")
    parser.add_argument("--sensor", default="hdl_64e", help="of --sequence")
    parser.add_argument("--labels", action="store_true", help="send the labels of --sequence, too")
    parser.add_argument("--rate", type=float, help="times real time; as fast as the server maps if left out")
    parser.add_argument("--domain", type=int, default=87, help="DDS domain, of nobody else")
    arguments = parser.parse_args()
    print("| drive | loops | ATE, worst pose [m] | voxels | fixed preserved, moving rejected | closed | corrections | "
          "longest correction [ms] | scan to pose [ms] |\n|---|---|---|---|---|---|---|---|---|", flush=True)
    is_worse = False
    drives = ([(arguments.sequence.name, None, arguments.sensor, arguments.labels)] if arguments.sequence else
              [drive for drive in DRIVES if arguments.only in drive[0]])
    for name, simulate, sensor, has_labels in drives:
        sequence = arguments.sequence or arguments.results / simulate.replace("--", "").replace(" ", "_")
        if not (sequence / "times.txt").exists():
            shutil.rmtree(sequence, ignore_errors=True)
            call([arguments.programs / "stillmap", "simulate", sequence, *simulate.split()])
        errors, reference = [], None
        for closes in (False, True):
            kind = "served_closed" if closes else "served_open"
            folder = arguments.results / kind / name.replace(", ", "_").replace(" ", "_")
            status = serve(arguments, sequence, sensor, has_labels, folder, closes)
            error_m, row = row_of(arguments, sequence, folder, status, reference)
            reference = folder / "path.tum"
            errors.append(error_m)
            print(f"| {name} | {'closed' if closes else 'open'} | {row}", flush=True)
        is_worse |= simulate is not None and errors[1] > errors[0] + 0.01
    return 1 if is_worse else 0


if __name__ == "__main__":
    sys.exit(main())
