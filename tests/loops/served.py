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

from loops import call, inverse, matrix, times, true_poses

SENSORS = pathlib.Path(__file__).resolve().parents[2] / "config/sensors"
# A sensor file that is written: whoever maps with "vlp_16" has an odometry that drifts.
HALF_A_DEGREE_OFF = "vlp_16_off.yaml"
# name, options of 'stillmap simulate', sensor, whether the true labels are sent, too, and after how many scans the
# server is started again with the map that it has (0: never)
DRIVES = [
    ("quiet, 16 rings, seed 1, no labels", "--preset quiet --sensor vlp_16 --seed 1 --scans 1600", "vlp_16", False, 0),
    ("quiet, 64 rings, seed 2, no labels", "--preset quiet --sensor hdl_64e --seed 2 --scans 1400", "hdl_64e", False, 0),
    ("crowd, 16 rings, seed 4", "--preset crowd --sensor vlp_16 --seed 4 --scans 2600", "vlp_16", True, 0),
    ("quiet, 16 rings half a degree off, seed 1, no labels, loaded after 200",
     f"--preset quiet --sensor {HALF_A_DEGREE_OFF} --seed 1 --scans 1250", "vlp_16", False, 200),
    ("quiet, 16 rings half a degree off, seed 5, no labels, loaded after 200",
     f"--preset quiet --sensor {HALF_A_DEGREE_OFF} --seed 5 --scans 1600", "vlp_16", False, 200),
]


def write_sensor(folder):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / HALF_A_DEGREE_OFF).write_text((SENSORS / "vlp_16.yaml").read_text() + "elevation_offset_deg: 0.5\n")


def serve(arguments, sequence, sensor, has_labels, loaded_after, folder, closes):
    """The status of a server that was sent the drive, or its rest; its map is in the folder then."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    if loaded_after == 0:
        return serve_part(arguments, sequence, sensor, has_labels, [], folder, closes)
    serve_part(arguments, sequence, sensor, has_labels, ["--scans", loaded_after], folder, closes)
    return serve_part(arguments, sequence, sensor, has_labels, ["--start", loaded_after], folder, closes)


def serve_part(arguments, sequence, sensor, has_labels, part, folder, closes):
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
        replay = [arguments.programs / "stillmap", "replay", sequence, "--lossless", "--timeout", 60, *part, *on_domain]
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


def stored_poses(folder):
    with sqlite3.connect(folder / "map.stillmap") as database:
        poses = list(database.execute(
            "SELECT stamp_ns, x, y, z, qx, qy, qz, qw FROM trajectory ORDER BY position"))
    return poses


def write_path(folder):
    poses = stored_poses(folder)
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


def matrix_of(x, y, z, qx, qy, qz, qw):
    return matrix([1 - 2 * (qy * qy + qz * qz), 2 * (qx * qy - qz * qw), 2 * (qx * qz + qy * qw), x,
                   2 * (qx * qy + qz * qw), 1 - 2 * (qx * qx + qz * qz), 2 * (qy * qz - qx * qw), y,
                   2 * (qx * qz - qy * qw), 2 * (qy * qz + qx * qw), 1 - 2 * (qx * qx + qy * qy), z])


def revisit_errors(sequence, folder, loaded_after):
    """How far poses 30 s and more after the map was loaded are, where they come within 3 m of one of
    the loaded map, from where they belong beside that one."""
    truth = dict(zip((sequence / "times.txt").read_text().split(), true_poses(sequence)))
    truth = {round(float(stamp) * 1e9): pose for stamp, pose in truth.items()}
    path = [(truth[min(truth, key=lambda t, s=stamp: abs(t - s))], matrix_of(*pose))
            for stamp, *pose in stored_poses(folder)]
    found = []
    for true, pose in path[loaded_after + 300:]:
        def apart(other, true=true):
            return math.dist([row[3] for row in other[0][:3]], [row[3] for row in true[:3]])
        nearest = min(path[:loaded_after], key=apart)
        if apart(nearest) > 3.0:
            continue
        true_motion, motion = times(inverse(nearest[0]), true), times(inverse(nearest[1]), pose)
        found.append(math.dist([row[3] for row in true_motion[:3]], [row[3] for row in motion[:3]]))
    return found


def revisits(sequence, folder, loaded_after):
    found = revisit_errors(sequence, folder, loaded_after) if loaded_after else []
    return f"{sorted(found)[len(found) // 2]:.2f}, {max(found):.2f} ({len(found)} scans)" if found else "-"


def row_of(arguments, sequence, folder, status, reference, loaded_after):
    path = write_path(folder)
    truth = true_path(sequence, folder) or reference or path
    errors = json.loads(call([arguments.programs / "stillmap", "evaluate", "trajectory", "--json",
                              "--estimate", path, "--truth", truth, "--max-difference", 0.001]))
    kept = "-"
    if (sequence / "labels").exists() and not loaded_after:
        found = json.loads(call([arguments.programs / "stillmap", "evaluate", "map", "--truth", sequence,
                                 "--map", folder / "map.stillmap", "--json"]))
        kept = f"{100 * found['preservation_rate']:.1f} %, {100 * found['rejection_rate']:.1f} %"
    counters = status["counters"]
    longest = {stage: f"{time['max_ms']:.0f}" for stage, time in status["latencies"].items()}
    return errors["ate_rmse_m"], (
        f"{errors['ate_rmse_m']:.3f}, {errors['ate_max_m']:.3f} | {status['voxels']:,} | {kept} | "
        f"{counters.get('loops_closed', 0)} | {counters.get('map_corrections', 0)} | {longest.get('correction', '-')} | {longest['pose']} | "
        f"{revisits(sequence, folder, loaded_after)} |")


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
          "longest correction [ms] | scan to pose [ms] | beside the loaded map: median, worst [m] |\n"
          "|---|---|---|---|---|---|---|---|---|---|", flush=True)
    is_worse = False
    drives = ([(arguments.sequence.name, None, arguments.sensor, arguments.labels, 0)] if arguments.sequence else
              [drive for drive in DRIVES if arguments.only in drive[0]])
    for name, simulate, sensor, has_labels, loaded_after in drives:
        sequence = arguments.sequence or arguments.results / simulate.replace("--", "").replace(" ", "_")
        if not (sequence / "times.txt").exists():
            shutil.rmtree(sequence, ignore_errors=True)
            write_sensor(arguments.results)
            # Sensor files are named from there.
            call([arguments.programs / "stillmap", "simulate", sequence, *simulate.split()], arguments.results)
        errors, reference = [], None
        for closes in (False, True):
            kind = "served_closed" if closes else "served_open"
            folder = arguments.results / kind / name.replace(", ", "_").replace(" ", "_")
            status = serve(arguments, sequence, sensor, has_labels, loaded_after, folder, closes)
            error_m, row = row_of(arguments, sequence, folder, status, reference, loaded_after)
            reference = folder / "path.tum"
            errors.append(error_m)
            print(f"| {name} | {'closed' if closes else 'open'} | {row}", flush=True)
        is_worse |= simulate is not None and errors[1] > errors[0] + 0.01
    return 1 if is_worse else 0


if __name__ == "__main__":
    sys.exit(main())
