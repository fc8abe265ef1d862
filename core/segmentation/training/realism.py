#!/usr/bin/env python3
"""Says where simulated scans look other than real ones to a network: per class, how far the
distributions of what a range image shows lie apart.

  realism.py --real kitti --simulated data/training [--scans 80]

Both are SemanticKITTI folders with labels; scans of sensors with other rings than the real ones are
left out. A distance is that of Kolmogorov and Smirnov: 0 for the same distribution, 1 for disjoint
ones; the medians stand beside it. The table begins with the largest.

  share      of a scan's labelled pixels
  range      [m]
  remission  0..1
  height     above the sensor [m]
  rough      second difference of range along a row, relative to the range
  porous     relative jump of range to the next pixel in the row
  holes      share of empty pixels among the eight about a pixel
"""

import argparse

import numpy as np

from range_images import ImageModel, project
from scans import CLASS_NAMES, IGNORED, ScanFiles

# Of each class and measure; distance, class, measure, real median, simulated median.
Measured = dict[tuple[int, str], np.ndarray]
Row = tuple[float, str, str, float, float]

MEASURES = ("share", "range", "remission", "height", "rough", "porous", "holes")
# Of a class in a scan; more pixels say no more about a distribution.
MOST_PIXELS = 400
FEWEST_PIXELS = 100


def row_differences(depth: np.ndarray, seen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Relative jump to the next pixel of the row, and relative second difference; NaN at holes."""
    depth = np.where(seen, depth, np.nan)
    after, before = np.roll(depth, -1, axis=1), np.roll(depth, 1, axis=1)
    return np.abs(after - depth) / depth, np.abs(before - 2 * depth + after) / depth


def share_of_holes(seen: np.ndarray) -> np.ndarray:
    empty = np.pad(~seen, ((1, 1), (0, 0)), mode="edge").astype(np.float32)
    rows = empty[:-2] + empty[1:-1] + empty[2:]
    around = np.roll(rows, 1, axis=1) + rows + np.roll(rows, -1, axis=1)
    return (around - ~seen) / 8


def measure(
    scans: ScanFiles,
    index: int,
    found: dict[tuple[int, str], list[np.ndarray]],
    random: np.random.Generator,
) -> None:
    """Adds what a scan shows of each class to `found` {(class, measure): [arrays]}."""
    points, remission, classes = scans.read(index)
    image = project(points, remission, scans.images[index])
    seen = image.point >= 0
    label = np.where(seen, classes[image.point], IGNORED)
    depth = image.channels[0]
    jump, second = row_differences(depth, seen)
    maps = dict(range=depth, remission=image.channels[4], height=image.channels[3])
    maps.update(rough=second, porous=jump, holes=share_of_holes(seen))
    labelled = np.count_nonzero(label)
    for k in np.unique(label[label != IGNORED]):
        place = np.flatnonzero(label == k)
        found.setdefault((k, "share"), []).append(np.array([len(place) / labelled]))
        place = random.permutation(place)[:MOST_PIXELS]
        for name, values in maps.items():
            chosen = values.ravel()[place]
            found.setdefault((k, name), []).append(chosen[np.isfinite(chosen)])


def measure_all(folder: str, most: int, rows: set[int] | None = None) -> tuple[Measured, set[int]]:
    scans = ScanFiles([folder], [], ImageModel(64, 2048, 3, -25))
    random, found, taken = np.random.default_rng(1), {}, set()
    for index in scans.evenly_chosen(most):
        if rows is None or scans.images[index].rows in rows:
            measure(scans, index, found, random)
            taken.add(scans.images[index].rows)
    return {key: np.concatenate(values) for key, values in found.items()}, taken


def distance(one: np.ndarray, other: np.ndarray) -> float:
    """The statistic of Kolmogorov and Smirnov of two samples."""
    values = np.sort(np.concatenate([one, other]))
    shares = [np.searchsorted(np.sort(v), values, side="right") / len(v) for v in (one, other)]
    return float(np.abs(shares[0] - shares[1]).max())


def compare(real: Measured, simulated: Measured) -> list[Row]:
    """[(distance, class, measure, real median, simulated median)], largest distance first."""
    rows = []
    for (k, name), values in real.items():
        others = simulated.get((k, name))
        enough = 3 if name == "share" else FEWEST_PIXELS
        if others is None or min(len(values), len(others)) < enough:
            continue
        medians = float(np.median(values)), float(np.median(others))
        rows.append((distance(values, others), CLASS_NAMES[k], name, *medians))
    return sorted(rows, reverse=True)


def show(rows: list[Row]) -> None:
    classes = [name for name in CLASS_NAMES if any(row[1] == name for row in rows)]
    print("distance".ljust(15) + "".join(name.rjust(10) for name in MEASURES))
    for label in classes:
        cells = {row[2]: row[0] for row in rows if row[1] == label}
        line = "".join(f"{cells[m]:10.2f}" if m in cells else "-".rjust(10) for m in MEASURES)
        print(label.ljust(15) + line)
    print(f"\nmean {np.mean([row[0] for row in rows]):.3f}; the largest, and both medians:")
    for far, label, name, real, simulated in rows[:20]:
        print(f"{far:.2f}  {label} {name}: real {real:.3g}, simulated {simulated:.3g}")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--real", required=True)
    parser.add_argument("--simulated", required=True)
    parser.add_argument("--scans", type=int, default=80, help="at most, of each")
    arguments = parser.parse_args()
    real, rows = measure_all(arguments.real, arguments.scans)
    simulated, _ = measure_all(arguments.simulated, arguments.scans, rows)
    show(compare(real, simulated))


if __name__ == "__main__":
    main()
