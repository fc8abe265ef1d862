"""Mixes labelled scans, so that few of them make many different training images.

A part of one scan beside or above a part of another (PolarMix, Xiao et al., NeurIPS 2022; LaserMix,
Kong et al., CVPR 2023), and objects of one scan set into another. The scans may be real or simulated.
"""

import numpy as np

from range_images import ImageModel, elevation_rad
from scans import CLASS_NAMES, Scan, ScanFiles

GROUND = np.isin(CLASS_NAMES, ["road", "parking", "sidewalk", "other-ground", "terrain"])
OBJECTS = np.isin(
    CLASS_NAMES,
    "car bicycle motorcycle truck other-vehicle person bicyclist motorcyclist".split(),
)


def turned(points: np.ndarray, angle_rad: float) -> np.ndarray:
    """Points after a rotation about the vertical."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return points @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]], np.float32)


def joined(one: Scan, other: Scan) -> Scan:
    return tuple(np.concatenate(parts) for parts in zip(one, other))


def _chosen(scan: Scan, mask: np.ndarray) -> Scan:
    return tuple(values[mask] for values in scan)


def mix_sectors(
    one: Scan, other: Scan, azimuth_rad: float, width_rad: float, random: np.random.Generator
) -> Scan:
    """`one` on the left of an azimuth drawn within a sector, `other` on its right."""
    border = azimuth_rad + width_rad * random.uniform(-0.35, 0.35)

    def left(points: np.ndarray) -> np.ndarray:
        x, y = points[:, 0], points[:, 1]
        return np.cos(border) * y > np.sin(border) * x

    return joined(_chosen(one, left(one[0])), _chosen(other, ~left(other[0])))


def mix_bands(one: Scan, other: Scan, model: ImageModel, random: np.random.Generator) -> Scan:
    """Bands of elevation, taken from `one` and `other` in turn; their borders are drawn."""
    down, up = np.radians([model.fov_down_deg, model.fov_up_deg])
    borders = np.sort(random.uniform(down, up, random.integers(1, 5)))
    first = random.integers(2)

    def odd(points: np.ndarray) -> np.ndarray:
        return (np.searchsorted(borders, elevation_rad(points)) + first) % 2 == 1

    return joined(_chosen(one, odd(one[0])), _chosen(other, ~odd(other[0])))


def height_of_ground(
    points: np.ndarray, classes: np.ndarray, x: float, y: float, radius_m: float = 2.5
) -> float | None:
    """Median height [m] of the ground about a place; None where too little of it was measured."""
    near = GROUND[classes] & (np.hypot(points[:, 0] - x, points[:, 1] - y) < radius_m)
    return float(np.median(points[near, 2])) if near.sum() >= 5 else None


class Objects:
    """Vehicles and people of labelled scans, cut out by their instance ids."""

    MIN_POINTS = 20
    # Measured nearer, an object would show where the sensor did not see it.
    MIN_RANGE_M = 2.5

    def __init__(
        self, scans: ScanFiles, most_scans: int = 400, most_of_class: int = 300, seed: int = 1
    ) -> None:
        """Cuts out of at most `most_scans` of `scans` (ScanFiles), evenly chosen in each folder."""
        self.of_class = {}
        self.most_of_class = most_of_class
        random = np.random.default_rng(seed)
        for index in scans.evenly_chosen(most_scans):
            self._cut_out(*scans.read_instances(index))
        for objects in self.of_class.values():
            random.shuffle(objects)
            del objects[most_of_class:]

    def _cut_out(
        self, points: np.ndarray, remission: np.ndarray, classes: np.ndarray, instances: np.ndarray
    ) -> None:
        named = np.flatnonzero(OBJECTS[classes] & (instances > 0))
        keys = classes[named].astype(np.int64) << 16 | instances[named]
        for key in np.unique(keys):
            members = named[keys == key]
            x, y, _ = np.median(points[members], axis=0)
            if len(members) < self.MIN_POINTS or np.hypot(x, y) < self.MIN_RANGE_M:
                continue
            ground_m = height_of_ground(points, classes, x, y)
            if ground_m is not None:
                part = _chosen((points, remission, classes), members)
                self.of_class.setdefault(int(key >> 16), []).append((*part, ground_m))

    def __len__(self) -> int:
        return sum(map(len, self.of_class.values()))

    def set_into(
        self, scan: Scan, azimuth_rad: float, width_rad: float, random: np.random.Generator
    ) -> Scan:
        """`scan` with an object of a random class, turned about the sensor into the sector, on the
        ground there; `scan` itself where no ground is."""
        if not self.of_class:
            return scan
        objects = self.of_class[random.choice(list(self.of_class))]
        points, remission, classes, ground_m = objects[random.integers(len(objects))]
        if random.random() < 0.5:
            points = points * np.array([1, -1, 1], np.float32)
        x, y, _ = np.median(points, axis=0)
        wanted_rad = azimuth_rad + width_rad * random.uniform(-0.45, 0.45)
        points = turned(points, wanted_rad - np.arctan2(y, x))
        x, y, _ = np.median(points, axis=0)
        new_ground_m = height_of_ground(scan[0], scan[2], x, y)
        if new_ground_m is None or abs(new_ground_m - ground_m) > 1.5:
            return scan
        lift = np.array([0, 0, new_ground_m - ground_m], np.float32)
        return joined(scan, (points + lift, remission, classes))
