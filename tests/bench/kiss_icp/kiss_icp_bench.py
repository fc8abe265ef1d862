#!/usr/bin/env python3
"""Time of odometry and map against KISS-ICP's odometry, on the same scans in the same run.

  tests/bench/kiss_icp/kiss_icp_bench.py --kiss-icp kiss-icp/cpp --sophus sophus SEQUENCE...

Fetches nothing: --kiss-icp is the folder cpp/ of KISS-ICP's sources, --sophus that of Sophus (1.24 or before,
with sophus/se3.hpp in it); Eigen, oneTBB and robin-map are Debian's libeigen3-dev, libtbb-dev and
librobin-map-dev unless folders are given. Both are compiled for the same processor (--march). They take turns;
of --repeats runs the fastest counts. Exit code 1 when a ratio is above --max-ratio.
"""
import argparse
import json
import pathlib
import statistics
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[2]


class BenchFailed(Exception):
    pass


def call(command):
    try:
        done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)
    except OSError as error:
        raise BenchFailed(f"{command[0]}: {error.strerror}") from error
    if done.returncode != 0:
        raise BenchFailed(f"{' '.join(map(str, command))}: exit code {done.returncode}\n{done.stderr.strip()[-2000:]}")
    return done.stdout


def require(folder, file, what):
    if not (folder / file).is_file():
        raise BenchFailed(f"{folder}: no {file} in it; name the folder of {what}")


def build_runner(arguments):
    """Compiles the runner, unless it is there and newer than its source."""
    require(arguments.kiss_icp, "kiss_icp/pipeline/KissICP.cpp", "KISS-ICP's cpp/ (--kiss-icp)")
    require(arguments.sophus, "sophus/se3.hpp", "Sophus (--sophus)")
    require(arguments.eigen, "Eigen/Core", "Eigen (--eigen)")
    source = HERE / "kiss_icp_runner.cpp"
    runner = arguments.build / "kiss_icp_runner"
    if runner.exists() and runner.stat().st_mtime > source.stat().st_mtime:
        return runner
    arguments.build.mkdir(parents=True, exist_ok=True)
    library = arguments.kiss_icp / "kiss_icp"
    systems = [word for folder in (arguments.eigen, arguments.tbb, arguments.robin_map) if folder
               for word in ("-isystem", folder)]
    print("compiling KISS-ICP, about a minute", file=sys.stderr)
    call([arguments.compiler, "-std=c++20", "-O3", "-DNDEBUG", f"-march={arguments.march}",
          "-DSOPHUS_USE_BASIC_LOGGING", "-w", "-I", arguments.kiss_icp, "-isystem", arguments.sophus, *systems,
          source, library / "pipeline/KissICP.cpp", *sorted((library / "core").glob("*.cpp")),
          "-ltbb", "-o", runner])
    return runner


def lines_of(file):
    return [float(line) for line in file.read_text().split()]


def run_kiss_icp(runner, sequence, scans):
    with tempfile.TemporaryDirectory() as out:
        out = pathlib.Path(out)
        call([runner, sequence, out, *([scans] if scans else [])])
        ms = lines_of(out / "ms.txt")
        return {"scans": len(ms), "ms": statistics.median(ms),
                "processor_ms": statistics.median(lines_of(out / "processor_ms.txt"))}


def run_stillmap(stillmap, sequence, scans, labels):
    rows = json.loads(call([stillmap, "evaluate", "drives", sequence, "--labels", labels, "--json",
                            *(["--scans", scans] if scans else [])]))
    return {"scans": rows[0]["scans"], "ms": rows[0]["median_ms"], "processor_ms": rows[0]["median_processor_ms"]}


def fastest(runs):
    return {"scans": runs[0]["scans"], **{unit: min(run[unit] for run in runs) for unit in ("ms", "processor_ms")}}


def compare(arguments, runner, sequence):
    kiss_icp, stillmap = [], []
    for _ in range(arguments.repeats):
        kiss_icp.append(run_kiss_icp(runner, sequence, arguments.scans))
        stillmap.append(run_stillmap(arguments.stillmap, sequence, arguments.scans, arguments.labels))
    kiss_icp, stillmap = fastest(kiss_icp), fastest(stillmap)
    if kiss_icp["scans"] != stillmap["scans"]:
        raise BenchFailed(f"{sequence}: KISS-ICP took {kiss_icp['scans']} scans, stillmap {stillmap['scans']}")
    return kiss_icp, stillmap


def row(cells):
    print("| " + " | ".join(cells) + " |", flush=True)


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequences", metavar="SEQUENCE", nargs="+", type=pathlib.Path,
                        help="SemanticKITTI folders with velodyne/")
    parser.add_argument("--kiss-icp", type=pathlib.Path, required=True, help="folder cpp/ of KISS-ICP's sources")
    parser.add_argument("--sophus", type=pathlib.Path, required=True, help="folder of Sophus' sources")
    parser.add_argument("--eigen", type=pathlib.Path, default=pathlib.Path("/usr/include/eigen3"))
    parser.add_argument("--tbb", type=pathlib.Path, help="folder with tbb/, where it is not installed")
    parser.add_argument("--robin-map", type=pathlib.Path, help="folder with tsl/, where it is not installed")
    parser.add_argument("--stillmap", type=pathlib.Path, default=ROOT / "build/release/bin/stillmap")
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build/release/tests/bench/kiss_icp",
                        help="where the runner is built")
    parser.add_argument("--compiler", default="c++")
    parser.add_argument("--march", default="x86-64-v3", help="that of stillmap, STILLMAP_ARCH")
    parser.add_argument("--labels", choices=["files", "none"], default="files")
    parser.add_argument("--scans", type=int, help="so many of each sequence at most")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--max-ratio", type=float, help="of the processor time")
    return parser.parse_args()


def main():
    arguments = parse_arguments()
    try:
        runner = build_runner(arguments)
        row(["sequence", "scans", "KISS-ICP ms", "stillmap ms", "ratio", "KISS-ICP processor ms",
             "stillmap processor ms", "ratio"])
        row(["---"] * 8)
        worst = 0.0
        for sequence in arguments.sequences:
            kiss_icp, stillmap = compare(arguments, runner, sequence)
            ratios = {unit: stillmap[unit] / kiss_icp[unit] for unit in ("ms", "processor_ms")}
            worst = max(worst, ratios["processor_ms"])
            row([sequence.name, str(stillmap["scans"])] +
                [text for unit in ("ms", "processor_ms")
                 for text in (f"{kiss_icp[unit]:.1f}", f"{stillmap[unit]:.1f}", f"{ratios[unit]:.2f}")])
    except BenchFailed as error:
        print(error, file=sys.stderr)
        return 1
    return 1 if arguments.max_ratio and worst > arguments.max_ratio else 0


if __name__ == "__main__":
    sys.exit(main())
