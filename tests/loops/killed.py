#!/usr/bin/env python3
"""Kills a server with SIGKILL while it corrects its map, and looks at what it had stored.

  tests/loops/killed.py --programs build/release/bin --results build/release/loops --kills 10

A drive comes back to where it was; within two seconds of a place that is seen again the server dies. Its file has to be
a valid map of one piece, as it was before the correction or after: the path without a step that the robot did not make,
the fixed voxels where the path says that they were seen, and a server that is started again goes on with it. The drive
is not simulated again if it is there. Prints a row for each kill; exit code 1 when one of them left anything else.
"""
import argparse
import json
import math
import pathlib
import random
import shutil
import signal
import subprocess
import sys
import time

from loops import call, true_poses
from served import HALF_A_DEGREE_OFF, stored_poses, write_sensor

# By a drift that makes corrections large.
DRIVE = f"--preset quiet --sensor {HALF_A_DEGREE_OFF} --seed 5 --scans 1600"
MIN_PRESERVED = 0.9
MAX_STEP_ERROR_M = 0.5


def simulated(arguments):
    sequence = arguments.results / "killed_drive"
    if not (sequence / "times.txt").exists():
        shutil.rmtree(sequence, ignore_errors=True)
        write_sensor(arguments.results)
        call([arguments.programs / "stillmap", "simulate", sequence, *DRIVE.split()], arguments.results)
    return sequence


def started(arguments, folder):
    log = open(folder / "server.log", "ab")
    server = subprocess.Popen([arguments.programs / "stillmap-server", "--config", folder / "server.yaml"], stderr=log)
    log.close()
    time.sleep(1)
    if server.poll() is not None:
        sys.exit(f"the server did not start:\n{(folder / 'server.log').read_text()}")
    return server


def is_recognised(log, times_seen):
    return log.read_text().count("a place was seen again") >= times_seen


def kill_in_correction(arguments, sequence, folder, dice):
    """Whether there was a correction to kill it in; and what the server's log says of those that had ended."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    (folder / "server.yaml").write_text(
        f"sensor: vlp_16\ndds: {{domain_id: {arguments.domain}, interfaces: [127.0.0.1]}}\n"
        "input: {delivery: every}\nlabels: {source: stream}\nmap: {file: map.stillmap, save_period_s: 1}\n")
    server = started(arguments, folder)
    replay = subprocess.Popen(
        [str(word) for word in (arguments.programs / "stillmap", "replay", sequence, "--lossless", "--timeout", 60,
                                "--no-labels", "--domain", arguments.domain, "--interface", "127.0.0.1")],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    times_seen = dice.randint(1, 12)
    while replay.poll() is None and server.poll() is None and not is_recognised(folder / "server.log", times_seen):
        time.sleep(0.02)
    is_moment = replay.poll() is None and server.poll() is None
    time.sleep(dice.uniform(0.0, 2.0))
    server.send_signal(signal.SIGKILL)
    server.wait()
    replay.kill()
    replay.wait()
    return is_moment, (folder / "server.log").read_text().count("map corrected")


def largest_step_error_m(sequence, poses):
    """By how much a step of the stored path is longer or shorter than the true one."""
    stamps = (sequence / "times.txt").read_text().split()
    truth = {round(float(stamp) * 1e9): pose for stamp, pose in zip(stamps, true_poses(sequence))}
    nearest = {stamp: min(truth, key=lambda t, s=stamp: abs(t - s)) for stamp, *_ in poses}
    largest = 0.0
    for (before, *a), (after, *b) in zip(poses, poses[1:]):
        true_a, true_b = (([row[3] for row in truth[nearest[stamp]][:3]]) for stamp in (before, after))
        largest = max(largest, abs(math.dist(a[:3], b[:3]) - math.dist(true_a, true_b)))
    return largest


def faults_of(arguments, sequence, folder):
    """What is wrong with the file, in words; and its figures for the table."""
    file = folder / "map.stillmap"
    program = arguments.programs / "stillmap"
    checked = subprocess.run([program, "map-check", file], capture_output=True, text=True, check=False)
    if checked.returncode != 0:
        return [f"map-check: {checked.stdout}{checked.stderr}".strip()], "- | - | - | -"
    poses = stored_poses(folder)
    step_error_m = largest_step_error_m(sequence, poses)
    found = json.loads(call([program, "evaluate", "map", "--truth", sequence, "--map", file, "--json"]))
    faults = []
    if step_error_m > MAX_STEP_ERROR_M:
        faults.append(f"its path has a step that is {step_error_m:.2f} m off")
    if found["preservation_rate"] < MIN_PRESERVED:
        faults.append(f"only {100 * found['preservation_rate']:.1f} % of what its path saw is there")
    server = started(arguments, folder)
    try:
        status = json.loads(call([program, "status", "--json", "--domain", arguments.domain,
                                  "--interface", "127.0.0.1"]))
    finally:
        server.send_signal(signal.SIGTERM)
        server.wait(timeout=120)
    if server.returncode != 0:
        faults.append(f"a server on it ends with {server.returncode}")
    if status["voxels"] == 0:
        faults.append("a server on it has no voxels")
    return faults, f"{len(poses)} | {status['voxels']:,} | {step_error_m:.2f} | {100 * found['preservation_rate']:.1f}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--programs", required=True, type=lambda text: pathlib.Path(text).resolve())
    parser.add_argument("--results", required=True, type=lambda text: pathlib.Path(text).resolve())
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1, help="of the moments")
    parser.add_argument("--domain", type=int, default=88, help="DDS domain, of nobody else")
    arguments = parser.parse_args()
    sequence = simulated(arguments)
    dice = random.Random(arguments.seed)
    print("| kill | corrections that had ended | poses stored | voxels | largest step off [m] | preserved % | faults |\n"
          "|---|---|---|---|---|---|---|", flush=True)
    is_whole = True
    for number in range(1, arguments.kills + 1):
        folder = arguments.results / "killed"
        is_moment, corrections = kill_in_correction(arguments, sequence, folder, dice)
        faults, figures = faults_of(arguments, sequence, folder)
        if not is_moment:
            faults.append("no place was seen again before the drive ended")
        is_whole &= not faults
        print(f"| {number} | {corrections} | {figures} | {'; '.join(faults) or 'none'} |", flush=True)
    return 0 if is_whole else 1


if __name__ == "__main__":
    sys.exit(main())
