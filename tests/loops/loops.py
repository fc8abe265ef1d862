#!/usr/bin/env python3
"""Closes loops on simulated drives and checks every closure against the true poses.

  tests/loops/loops.py --program build/release/bin/stillmap --results build/release/loops
  tests/loops/loops.py ... --kilometres 50

A drive that is there is not simulated again. Prints a table for tests/README.md. With --kilometres drives in so many
cities as it takes instead, a row for each, which are removed again. Exit code 1 when a closure is wrong: its motion
off by more than 0.5 m or 2 degrees.
"""
import argparse
import json
import math
import pathlib
import shutil
import subprocess
import sys

# name, options of 'stillmap simulate', of 'stillmap map', whether it comes back to a place
DRIVES = [
    ("quiet, 16 rings", "--preset quiet --sensor vlp_16 --seed 1 --scans 1600", "", True),
    ("quiet, 16 rings, seed 5", "--preset quiet --sensor vlp_16 --seed 5 --scans 1600", "", True),
    ("circuit, 16 rings", "--preset circuit --sensor vlp_16 --seed 3 --scans 1300", "", True),
    ("quiet, 64 rings", "--preset quiet --sensor hdl_64e --seed 2 --scans 1400", "", True),
    ("quiet, 16 rings, no labels", "--preset quiet --sensor vlp_16 --seed 1 --scans 1600", "--labels none", True),
    ("crowd, 16 rings", "--preset crowd --sensor vlp_16 --seed 4 --scans 2600", "", True),
    ("quiet, one way", "--preset quiet --sensor vlp_16 --seed 9 --scans 600", "", False),
]


# Of them --kilometres takes one after the other, each with the next seed.
MANY = ["--preset circuit --sensor vlp_16 --scans 1300", "--preset quiet --sensor vlp_16 --scans 1300",
        "--preset crowd --sensor vlp_16 --scans 1300", "--preset circuit --sensor hdl_32e --scans 900"]
FIRST_SEED = 1000


def call(command, folder=None):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False, cwd=folder)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}: exit code {done.returncode}\n{done.stderr.strip()[-2000:]}")
    return done.stdout


def matrix(numbers):
    rows = [list(map(float, numbers[4 * i:4 * i + 4])) for i in range(3)]
    return rows + [[0.0, 0.0, 0.0, 1.0]]


def times(a, b):
    return [[sum(a[i][k] * b[k][j] for k in range(4)) for j in range(4)] for i in range(4)]


def inverse(a):
    turned = [[a[j][i] for j in range(3)] for i in range(3)]
    shift = [-sum(turned[i][k] * a[k][3] for k in range(3)) for i in range(3)]
    return [turned[i] + [shift[i]] for i in range(3)] + [[0.0, 0.0, 0.0, 1.0]]


def true_poses(sequence):
    """Of the lidar; the files have the camera's."""
    lines = (sequence / "calib.txt").read_text().splitlines()
    camera_lidar = matrix(next(line for line in lines if line.startswith("Tr:")).split()[1:])
    lidar_camera = inverse(camera_lidar)
    return [times(lidar_camera, times(matrix(line.split()), camera_lidar))
            for line in (sequence / "poses.txt").read_text().splitlines()]


def errors(closure, poses):
    truth = times(inverse(poses[closure["from_scan"]]), poses[closure["to_scan"]])
    off = times(inverse(truth), matrix(closure["T_from_to"]))
    cosine = 0.5 * (off[0][0] + off[1][1] + off[2][2] - 1.0)
    return math.hypot(*(off[i][3] for i in range(3))), math.degrees(math.acos(max(-1.0, min(1.0, cosine))))


def row_of(name, report, poses):
    found = [errors(closure, poses) for closure in report["closures"]]
    wrong = sum(m > 0.5 or degrees > 2.0 for m, degrees in found)
    loops = report["loops"]
    before = loops["odometry_accuracy"]["ate_rmse_m"]
    kilometres = report["accuracy"]["path_m"] / 1000.0
    worst = f"{max(m for m, _ in found):.2f} m, {max(d for _, d in found):.2f} deg" if found else "-"
    return wrong, (f"| {name} | {report['scans']} | {kilometres:.2f} | {before:.3f} | "
                   f"{report['accuracy']['ate_rmse_m']:.3f} | {len(found)} | {wrong} | {worst} | "
                   f"{len(loops['refused'])} | {1000.0 * loops['seconds'] / report['scans']:.1f} | "
                   f"{loops['submaps_mib'] / kilometres:.0f} | {loops['kept_scans_mib'] / kilometres:.0f} |")


def mapped(arguments, sequence, out, options):
    return json.loads(call([arguments.program, "map", sequence, "--out", out, "--force", "--json", *options.split()]))


def close_in_many_cities(arguments):
    """Drives so many kilometres; returns how many closures were wrong."""
    kilometres, closures, wrong_ones, drives = 0.0, 0, 0, 0
    sequence, out = arguments.results / "many", arguments.results / "map_many"
    while kilometres < arguments.kilometres:
        simulate = f"{MANY[drives % len(MANY)]} --seed {FIRST_SEED + drives}"
        shutil.rmtree(sequence, ignore_errors=True)
        call([arguments.program, "simulate", sequence, *simulate.split()])
        report = mapped(arguments, sequence, out, "--labels none" if arguments.no_labels else "")
        wrong, row = row_of(simulate.replace("--", ""), report, true_poses(sequence))
        print(row, flush=True)
        drives += 1
        kilometres += report["accuracy"]["path_m"] / 1000.0
        closures += len(report["closures"])
        wrong_ones += wrong
    print(f"{drives} drives, {kilometres:.1f} km, {closures} closures, {wrong_ones} wrong")
    for folder in (sequence, out):
        shutil.rmtree(folder, ignore_errors=True)
    return wrong_ones


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", required=True, type=pathlib.Path)
    parser.add_argument("--results", required=True, type=pathlib.Path)
    parser.add_argument("--only", default="", help="drives with this in their name")
    parser.add_argument("--kilometres", type=float, help="drive so many in other cities instead")
    parser.add_argument("--no-labels", action="store_true", help="without labels, with --kilometres")
    arguments = parser.parse_args()
    wrong_ones = 0
    print("| drive | scans | km | ATE before [m] | after [m] | closures | wrong | worst error | refused | "
          "ms a scan | submaps [MiB/km] | kept scans [MiB/km] |")
    print("|---|---|---|---|---|---|---|---|---|---|---|---|", flush=True)
    if arguments.kilometres is not None:
        return 1 if close_in_many_cities(arguments) else 0
    for name, simulate, options, returns in DRIVES:
        if arguments.only not in name:
            continue
        sequence = arguments.results / simulate.replace("--", "").replace(" ", "_")
        if not (sequence / "poses.txt").exists():
            shutil.rmtree(sequence, ignore_errors=True)
            call([arguments.program, "simulate", sequence, *simulate.split()])
        out = arguments.results / ("map_" + name.replace(", ", "_").replace(" ", "_"))
        report = mapped(arguments, sequence, out, options)
        wrong, row = row_of(name, report, true_poses(sequence))
        print(row, flush=True)
        wrong_ones += wrong
        if returns and not report["closures"]:
            print(f"{name}: no loop was closed", file=sys.stderr)
    return 1 if wrong_ones else 0


if __name__ == "__main__":
    sys.exit(main())
