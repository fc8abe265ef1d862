#!/usr/bin/env python3
"""Puts drives onto the map of another day in the same simulated city, and checks where they end up.

  tests/loops/sessions.py --program build/release/bin/stillmap --results build/release/sessions

Every pose, and every closure, is measured from the nearest pose of the first day's drive, so that the drift of the map
is none of alignment's. A drive that is there is not simulated again. Prints a table for tests/README.md. Exit code 1
when a closure is wrong (off by more than 0.5 m or 2 degrees), a drive is not recognised, one of another city is, or a
withdrawn session leaves anything.
"""
import argparse
import json
import math
import pathlib
import shutil
import subprocess
import sys

from loops import inverse, matrix, times, true_poses

# name, city, scans of both days, options of 'stillmap map', options of another city
CASES = [
    ("yard 21, 16 rings", "--preset yard --sensor vlp_16 --seed 21", 600, 300, "", "--preset yard --sensor vlp_16 --seed 22"),
    ("the same, no labels", "--preset yard --sensor vlp_16 --seed 21", 600, 300, "--labels none", ""),
    ("yard 21, 16 rings, more than 40 submaps", "--preset yard --sensor vlp_16 --seed 21", 600, 1700, "", ""),
    ("yard 21, 64 rings", "--preset yard --sensor hdl_64e --seed 21", 600, 300, "", ""),
    ("the same 64 rings, no labels", "--preset yard --sensor hdl_64e --seed 21", 600, 300, "--labels none", ""),
    ("quiet 11, 16 rings", "--preset quiet --sensor vlp_16 --seed 11", 400, 400, "", "--preset quiet --sensor vlp_16 --seed 12"),
    ("crowd 6, 16 rings", "--preset crowd --sensor vlp_16 --seed 6", 400, 300, "", "--preset crowd --sensor vlp_16 --seed 7"),
    ("quiet 3, 64 rings, no labels", "--preset quiet --sensor hdl_64e --seed 3", 200, 150, "--labels none", ""),
]


def call(command, codes=(0,)):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)
    if done.returncode not in codes:
        sys.exit(f"{' '.join(map(str, command))}: exit code {done.returncode}\n{done.stderr.strip()[-2000:]}")
    return done


class Day:
    """A drive, its true poses in the city."""

    def __init__(self, program, results, options, day, scans):
        self.folder = results / f"{options} day {day} {scans}".replace("--", "").replace(" ", "_")
        if not (self.folder / "first_pose_city.txt").exists():
            shutil.rmtree(self.folder, ignore_errors=True)
            call([program, "simulate", self.folder, *options.split(), "--day", day, "--scans", scans])
        first = matrix((self.folder / "first_pose_city.txt").read_text().split())
        self.truth = [times(first, pose) for pose in true_poses(self.folder)]


def poses_of(out):
    return [matrix(line.split()) for line in (out / "poses_lidar.txt").read_text().splitlines()]


def distance(a, b):
    return math.dist([a[i][3] for i in range(3)], [b[i][3] for i in range(3)])


def error(first, first_poses, truth, pose):
    """Of a pose in the first map, from the nearest pose of the first drive; nothing far from it."""
    nearest = min(range(len(first_poses)), key=lambda i: distance(first.truth[i], truth))
    if distance(first.truth[nearest], truth) > 10.0:
        return None
    motion = times(inverse(first_poses[nearest]), pose)
    off = times(inverse(times(inverse(first.truth[nearest]), truth)), motion)
    cosine = 0.5 * (off[0][0] + off[1][1] + off[2][2] - 1.0)
    return math.hypot(*(off[i][3] for i in range(3))), math.degrees(math.acos(max(-1.0, min(1.0, cosine))))


def row_of(program, results, case):
    name, city, first_scans, second_scans, options, other = case
    one = Day(program, results, city, 1, first_scans)
    two = Day(program, results, city, 2, second_scans)
    key = name.replace(", ", "_").replace(" ", "_")
    first_out, out = results / f"{key}_first", results / f"{key}_both"
    first = json.loads(call([program, "map", one.folder, "--out", first_out, "--force", "--json", *options.split()]).stdout)
    onto = ["--onto", first_out / "map.stillmap", "--force", "--json", *options.split()]
    report = json.loads(call([program, "map", two.folder, "--out", out, *onto]).stdout)
    first_poses, poses = poses_of(first_out), poses_of(out)
    closures = [error(one, first_poses, two.truth[c["scan"]], matrix(c["T_map_lidar"])) for c in report["onto"]["closures"]]
    closures = [c for c in closures if c]
    found = [e for e in (error(one, first_poses, truth, pose) for truth, pose in zip(two.truth, poses)) if e]
    wrong = sum(m > 0.5 or degrees > 2.0 for m, degrees in closures)
    diff = json.loads(call([program, "map-diff", first_out / "map.stillmap", out / "map.stillmap", "--json"]).stdout)
    back = results / f"{key}_back.stillmap"
    call([program, "sessions", out / "map.stillmap", "--withdraw", 2, "--out", back, "--force"])
    same = call([program, "map-diff", "--tolerance", 0, first_out / "map.stillmap", back]).stdout
    refused = "-"
    if other:
        elsewhere = Day(program, results, other, 1, 200)
        done = call([program, "map", elsewhere.folder, "--out", results / f"{key}_other", *onto], (0, 5))
        refused = "yes" if done.returncode == 5 else "NO"
    rms = math.sqrt(sum(m * m for m, _ in found) / max(len(found), 1))
    bad = wrong + (refused == "NO") + ("nothing changed" not in same)
    return bad, (f"| {name} | {first['scans']}, {report['scans']} | {report['onto']['found']} of {report['onto']['localized']} | "
                 f"{len(report['onto']['closures'])} | {wrong} | {max(m for m, _ in closures):.2f} m, "
                 f"{max(d for _, d in closures):.2f} deg | {rms:.3f} m, {max(m for m, _ in found):.2f} m | "
                 f"{first['voxels']} | {100.0 * (report['voxels'] / first['voxels'] - 1.0):+.1f} % | "
                 f"{100.0 * diff['appeared'] / first['voxels']:.1f} %, {100.0 * diff['removed'] / first['voxels']:.1f} % | "
                 f"{report['onto']['seconds']:.1f} | {refused} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--program", required=True, type=pathlib.Path)
    parser.add_argument("--results", required=True, type=pathlib.Path)
    parser.add_argument("--only", default="", help="cases with this in their name")
    arguments = parser.parse_args()
    bad_ones = 0
    print("| city | scans, first and second day | found of looked for | closures | wrong | worst closure | poses: RMS, worst | "
          "voxels | growth | appeared, removed beyond a cell | s | another city refused |")
    print("|---|---|---|---|---|---|---|---|---|---|---|---|", flush=True)
    for case in CASES:
        if arguments.only in case[0]:
            bad, row = row_of(arguments.program, arguments.results, case)
            print(row, flush=True)
            bad_ones += bad
    return 1 if bad_ones else 0


if __name__ == "__main__":
    sys.exit(main())
