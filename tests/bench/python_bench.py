#!/usr/bin/env python3
"""The Python module beside the command line: a map file's opening, and a region of a running server.

    python_bench.py BUILD [MAP]

MAP: of a drive; default: that of `make bench-web`, whose large map is opened as well. Both programs
ask in turns, 100 times each, three times.
"""
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

DOMAIN = 98
ASKED = 100
BOX = (60.0, -25.0, -100.0, 110.0, 25.0, 100.0)


def milliseconds(work) -> float:
    began = time.perf_counter()
    work()
    return 1e3 * (time.perf_counter() - began)


def print_opening(stillmap, file: Path):
    taken, opened_map = [], None
    for _ in range(6):
        opened_map = None  # Freed beside the clock.
        began = time.perf_counter()
        opened_map = stillmap.open_map(file)
        taken.append(1e3 * (time.perf_counter() - began))
    first, again = taken[0], taken[1:]
    count = len(opened_map.voxels())
    arrays = min(milliseconds(opened_map.voxels) for _ in range(5))
    print(f"{file.name}: {count} voxels; ms a million: opened for the first time {1e6 * first / count:.0f}, "
          f"again {1e6 * min(again) / count:.0f} to {1e6 * max(again) / count:.0f}; arrays {1e6 * arrays / count:.0f}")


def print_queries(stillmap, build: Path, file: Path):
    with tempfile.TemporaryDirectory() as folder:
        shutil.copy(file, f"{folder}/map.stillmap")
        server = subprocess.Popen([build / "bin/stillmap-server", "--domain", str(DOMAIN), "--map-file",
                                   f"{folder}/map.stillmap"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            client = stillmap.Client(domain=DOMAIN, timeout_s=60.0)
            box = stillmap.Box(BOX[:3], BOX[3:])
            command = [str(build / "bin/stillmap"), "query", "--domain", str(DOMAIN), "--timeout", "60",
                       "--repeat", str(ASKED), "--box", *map(str, BOX)]
            for _ in range(3):
                ours = statistics.median(milliseconds(lambda: len(client.query(box))) for _ in range(ASKED))
                said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
                voxels, theirs = re.search(r"(\d+) voxels of map .* in ([\d.]+) ms", said).groups()
                print(f"a box of {voxels} voxels: Python {ours:.1f} ms, command line {theirs} ms, "
                      f"ratio {ours / float(theirs):.2f}")
        finally:
            server.terminate()
            server.wait()


def main():
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    build = Path(sys.argv[1]).resolve()
    sys.path.insert(0, str(build / "python"))
    import stillmap

    made = build / "bench_web"
    file = Path(sys.argv[2]) if len(sys.argv) == 3 else made / "mapped/map.stillmap"
    for opened in [file] if len(sys.argv) == 3 else [file, made / "large.stillmap"]:
        print_opening(stillmap, opened)
    print_queries(stillmap, build, file)


if __name__ == "__main__":
    main()
