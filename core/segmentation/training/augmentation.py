"""Augmentation of training scans, against overfitting to one sensor or one city."""

from typing import Any

import numpy as np

from range_images import RangeImage
from scans import IGNORED, Scan


def aim(
    points: np.ndarray,
    classes: np.ndarray,
    width_rad: float,
    share: float,
    random: np.random.Generator,
) -> float:
    """Azimuth [rad] of the middle of a crop of this width: uniform or, in this share of draws, such
    that the crop contains a point of a class drawn uniformly from those of the scan."""
    present = np.flatnonzero(np.bincount(classes))
    present = present[present != IGNORED]
    if random.random() >= share or not present.size:
        return random.uniform(-np.pi, np.pi)
    members = np.flatnonzero(classes == random.choice(present))
    x, y, _ = points[random.choice(members)]
    return np.arctan2(y, x) + width_rad * random.uniform(-0.5, 0.5)


def in_sector(points: np.ndarray, middle_rad: float, width_rad: float) -> np.ndarray:
    """Mask of the points in a sector around the vertical axis."""
    middle = np.array([np.cos(middle_rad), np.sin(middle_rad)], np.float32)
    distance = np.hypot(points[:, 0], points[:, 1])
    return points[:, :2] @ middle >= np.cos(min(width_rad / 2, np.pi)) * distance - 1e-3


def draw_motion(settings: dict[str, Any], random: np.random.Generator) -> np.ndarray:
    """A random 3 x 3 matrix, for multiplication from the right with rows of points: rotation about
    the vertical, mirroring, tilt and scale."""
    motion = np.eye(3)
    if settings["rotate"]:
        angle = random.uniform(-np.pi, np.pi)
        c, s = np.cos(angle), np.sin(angle)
        motion = motion @ [[c, s, 0], [-s, c, 0], [0, 0, 1]]
    if settings["flip"] and random.random() < 0.5:
        motion = motion @ np.diag([1, -1, 1])
    if settings["tilt_deg"]:
        roll, pitch = np.radians(random.normal(0, settings["tilt_deg"], 2))
        motion = motion @ [[1, 0, -pitch], [0, 1, -roll], [pitch, roll, 1]]
    motion = motion * random.uniform(1 - settings["scale"], 1 + settings["scale"])
    return motion.astype(np.float32)


def _change_remission(
    remission: np.ndarray, settings: dict[str, Any], random: np.random.Generator
) -> np.ndarray:
    """Random gain, offset, contrast and noise."""
    jitter = settings["remission_jitter"]
    gain, power = np.exp(random.normal(0, jitter, 2))
    noise = random.normal(0, 0.1 * jitter, remission.size).astype(np.float32)
    changed = gain * np.clip(remission, 0, 1) ** power + random.normal(0, 0.1 * jitter) + noise
    return np.clip(changed, 0, 1).astype(np.float32)


def augment_points(
    points: np.ndarray,
    remission: np.ndarray,
    classes: np.ndarray,
    motion: np.ndarray,
    settings: dict[str, Any],
    random: np.random.Generator,
) -> Scan:
    """A scan as another sensor might measure it: drops points, limits the range, applies `motion`,
    lifts the sensor, adds range noise, changes remission."""
    keep = random.random(len(points)) >= random.uniform(0, settings["drop_points"])
    far = random.uniform(settings["max_range_m"], 120)
    keep &= (points**2).sum(axis=1) < far**2
    points, remission, classes = points[keep], remission[keep], classes[keep]
    lift = np.array([0, 0, random.normal(0, settings["lift_m"])], np.float32)
    points = points @ motion + lift
    noise = random.normal(0, random.uniform(0, settings["range_noise_m"]), len(points))
    depth = np.sqrt((points**2).sum(axis=1))
    points = points * (1 + noise / depth).astype(np.float32)[:, None]
    return points, _change_remission(remission, settings, random), classes


def drop_beams(
    image: RangeImage, beams: int, settings: dict[str, Any], random: np.random.Generator
) -> None:
    """Clears the rows of beams: of random ones, and sometimes of every other one. Of more beams than
    rows, it drops rows."""
    rows = len(image.point)
    beams = min(beams, rows)
    lost = random.random(beams) < random.uniform(0, settings["drop_beams"])
    if random.random() < settings["halve_beams"]:
        lost[random.integers(2) :: 2] = True
    lost = lost[np.arange(rows) * beams // rows]
    image.point[lost] = -1
    image.channels[:, lost] = 0


def crop(
    channels: np.ndarray, target: np.ndarray, columns: int, azimuth_rad: float
) -> tuple[np.ndarray, np.ndarray]:
    """A crop of the image, `columns` wide, around this azimuth; it may cross the image's seam."""
    start = round(0.5 * (1 - azimuth_rad / np.pi) * channels.shape[2] - columns / 2)
    chosen = np.arange(start, start + columns) % channels.shape[2]
    return channels[:, :, chosen], target[:, chosen]
