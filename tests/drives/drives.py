#!/usr/bin/env python3
"""Runs every drive, simulated and recorded, and writes the tables into tests/drives/README.md.

  tests/drives/drives.py --program build/release/bin/stillmap --results build/release/drives

A drive that is finished is not run again: stop it at any time, and start it again. Results are lines of
JSON in RESULTS/runs.jsonl. Exit code 1 when a run failed.
"""
import argparse
import datetime
import json
import os
import pathlib
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

import page
import suite

ROOT = pathlib.Path(__file__).resolve().parents[2]


class RunFailed(Exception):
    pass


def call(command):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RunFailed(f"{' '.join(map(str, command))}: exit code {done.returncode}\n{done.stderr.strip()[-2000:]}")
    return done.stdout


def sequence_of(run, stillmap, folder):
    """A folder with the run's scans; simulated drives are written into `folder`."""
    if not run.drive.startswith("sim:"):
        return pathlib.Path(run.drive)
    preset, *words = run.drive[len("sim:"):].split(",")
    options = ["--preset", preset]
    for word in words:
        name, _, value = word.partition("=")
        options += ["--" + name] + ([value] if value else [])
    call([stillmap, "simulate", folder / "drive", *options])
    return folder / "drive"


def quantile(values, share):
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


def run_other_program(run, stillmap, results):
    """`PROGRAM SEQUENCE OUT` writes OUT/poses_lidar.txt (3x4, a line a scan) and OUT/ms.txt."""
    with tempfile.TemporaryDirectory(dir=results) as scratch:
        scratch = pathlib.Path(scratch)
        sequence = sequence_of(run, stillmap, scratch)
        out = scratch / "out"
        out.mkdir()
        call([run.program[1], sequence, out])
        ms = [float(line) for line in (out / "ms.txt").read_text().split()]
        truth = ["--truth", sequence / "poses_lidar.txt"]
        if not (sequence / "poses_lidar.txt").exists():
            truth = ["--truth", sequence / "poses.txt", "--truth-calib", sequence / "calib.txt"]
        trajectory = json.loads(call([stillmap, "evaluate", "trajectory", *truth,
                                      "--estimate", out / "poses_lidar.txt", "--json"]))
    return [{"weighting": run.program[0], "scans": len(ms), "trajectory": trajectory, "health": None,
             "median_ms": statistics.median(ms), "p99_ms": quantile(ms, 0.99)}]


def run_one(run, stillmap, results):
    if run.program:
        return run_other_program(run, stillmap, results)
    rows = json.loads(call([stillmap, "evaluate", "drives", *run.options()]))
    return rows if run.judged else [{**row, "health": None} for row in rows]


def commit():
    """Of the sources; with a + where they differ from it."""
    git = ["git", "-C", str(ROOT)]
    try:
        head = subprocess.run([*git, "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True)
        changed = subprocess.run([*git, "diff", "--quiet", "HEAD", "--", "*.cpp", "*.hpp"], check=False)
    except (OSError, subprocess.CalledProcessError):
        return "no commit"
    return head.stdout.strip() + ("+" if changed.returncode else "")


def machine():
    for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return f"{len(os.sched_getaffinity(0))} cores, {line.partition(':')[2].strip()}"
    return f"{len(os.sched_getaffinity(0))} cores"


def in_words(seconds):
    minutes = round(seconds / 60)
    return f"{minutes // 60} h {minutes % 60:02} min" if minutes >= 60 else f"{minutes} min"


def read_results(file):
    """Finished runs by name; of a run that was repeated, the last. A line that was cut off is none."""
    results = {}
    for line in file.read_text().splitlines() if file.exists() else ():
        try:
            result = json.loads(line)
        except json.JSONDecodeError:
            continue
        results[result["run"]] = result
    return results


def append_line(file, line):
    """On a line of its own, even after one that was cut off."""
    whole = not file.exists() or file.read_bytes()[-1:] in (b"", b"\n")
    with file.open("a") as out:
        out.write(("" if whole else "\n") + line + "\n")


def run_all(runs, arguments):
    """Runs what is not finished; returns the number of failures."""
    file = arguments.results / "runs.jsonl"
    finished = {} if arguments.fresh else read_results(file)
    waiting = [run for run in runs if run.name not in finished]
    print(f"{len(runs)} runs, {len(runs) - len(waiting)} of them finished before", flush=True)
    cost, done, failures = sum(run.cost for run in waiting), 0, 0
    began = time.monotonic()
    for number, run in enumerate(waiting, 1):
        elapsed = time.monotonic() - began
        left = in_words(elapsed * (cost - done) / done) + " left" if done else "time left not known yet"
        print(f"[{number}/{len(waiting)}] {run.name} ({left})", flush=True)
        run_began = time.monotonic()
        try:
            rows = run_one(run, arguments.program, arguments.results)
        except (RunFailed, OSError, ValueError) as error:
            failures += 1
            print(f"  failed: {error}", file=sys.stderr, flush=True)
        else:
            result = {"run": run.name, "group": run.group, "labels": run.labels, "mutation": run.mutation,
                      "commit": commit(), "date": datetime.date.today().isoformat(),
                      "seconds": round(time.monotonic() - run_began, 1),
                      "load": os.getloadavg()[0], "rows": rows}
            append_line(file, json.dumps(result))
        done += run.cost
    return failures


def named_program(text):
    name, equals, program = text.partition("=")
    path = shutil.which(program)
    if not (name and equals and path):
        raise argparse.ArgumentTypeError(f"'{text}' is not NAME=PROGRAM with a program that can be run")
    return name, os.path.abspath(path)


def with_poses(recordings, results):
    """The Livox Avia's recording comes with its poses under another name: a folder as stillmap reads it."""
    campus, avia = recordings / "avia_campus", results / "recordings" / "avia"
    if not (campus / "odom_poses.txt").is_file():
        return None
    avia.mkdir(parents=True, exist_ok=True)
    for name, source in (("velodyne", "velodyne"), ("times.txt", "times.txt"), ("poses_lidar.txt", "odom_poses.txt")):
        link = avia / name
        link.unlink(missing_ok=True)
        link.symlink_to((campus / source).resolve())
    return avia


def existing_folder(text):
    if not pathlib.Path(text).is_dir():
        raise argparse.ArgumentTypeError(f"there is no folder {text}")
    return pathlib.Path(text)


def parse(words):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="build/release/bin/stillmap", help="stillmap")
    parser.add_argument("--results", type=pathlib.Path, default=pathlib.Path("build/release/drives"))
    parser.add_argument("--recordings", type=existing_folder,
                        help="Folder with kitti_raw_0005, avia_campus and vlp16; missing ones are left out")
    parser.add_argument("--against", metavar="NAME=PROGRAM", type=named_program, action="append", default=[],
                        help="Another odometry: PROGRAM SEQUENCE OUT writes OUT/poses_lidar.txt and OUT/ms.txt")
    parser.add_argument("--only", default="", help="Run only what has this in its name or group; the page keeps the others")
    parser.add_argument("--weightings", nargs="+", choices=suite.WEIGHTINGS, default=suite.WEIGHTINGS,
                        help="These alone")
    parser.add_argument("--quick", action="store_true", help="2 seeds of 60 scans")
    parser.add_argument("--fresh", action="store_true", help="Run what is finished again")
    parser.add_argument("--list", action="store_true", help="Print the runs' names")
    parser.add_argument("--page", type=pathlib.Path, default=ROOT / "tests/drives/README.md",
                        help="Page that the tables go into; '-' prints it")
    return parser.parse_args(words)


def main(words):
    arguments = parse(words)
    extent = suite.Extent.quick() if arguments.quick else suite.Extent()
    arguments.results.mkdir(parents=True, exist_ok=True)
    avia = with_poses(arguments.recordings, arguments.results) if arguments.recordings else None
    everything = list(suite.weighed(suite.suite(extent, arguments.recordings, avia, arguments.against),
                                    arguments.weightings))
    runs = [run for run in everything if arguments.only in run.name or arguments.only in run.group]
    if arguments.list:
        print("\n".join(run.name for run in runs))
        return 0
    if not runs:
        print(f"no run contains '{arguments.only}'; --list prints all", file=sys.stderr)
        return 2
    failures = run_all(runs, arguments)
    results = read_results(arguments.results / "runs.jsonl")
    content = page.section([results[run.name] for run in everything if run.name in results], machine())
    if str(arguments.page) == "-":
        print(content)
    else:
        arguments.page.write_text(page.put_between_markers(arguments.page.read_text(), content))
    if failures:
        print(f"{failures} runs failed: start again to repeat them", file=sys.stderr)
    return 1 if failures else 0


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except KeyboardInterrupt:
        print("\nstopped: start again to go on", file=sys.stderr)
        sys.exit(130)
