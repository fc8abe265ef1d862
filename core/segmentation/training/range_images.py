"""Range images of lidar scans: the projection and normalisation that the C++ engine uses."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class ImageModel:
    """Size and vertical field of view of a range image, and the lidar's rings where it has another
    number of them than the image has rows."""

    rows: int
    columns: int
    fov_up_deg: float
    fov_down_deg: float
    rings: int | None = None

    @property
    def beams(self) -> int:
        return self.rows if self.rings is None else self.rings


@dataclass(frozen=True)
class RangeImage:
    """`channels`: 5 x rows x columns (range, x, y, z, remission), 0 where empty. `point` is the
    index of each pixel's nearest point, or -1; `pixel` the flat pixel of each point."""

    channels: np.ndarray
    point: np.ndarray
    pixel: np.ndarray


def elevation_rad(points: np.ndarray) -> np.ndarray:
    """Elevation of points (n x 3, none at the origin) above the lidar's horizontal plane."""
    return np.arcsin(points[:, 2] / np.sqrt((points**2).sum(axis=1)))


def project(points: np.ndarray, remission: np.ndarray, model: ImageModel) -> RangeImage:
    """Spherical projection; a pixel keeps the nearest of its points.

    `points`: n x 3 in the lidar's frame [m], all finite and none at the origin.
    """
    x, y, z = points[:, 0], points[:, 1], points[:, 2]
    depth = np.sqrt(x * x + y * y + z * z)
    down = np.radians(model.fov_down_deg)
    fov = np.radians(model.fov_up_deg) - down
    u = 0.5 * (1.0 - np.arctan2(y, x) / np.pi) * model.columns
    v = (1.0 - (np.arcsin(z / depth) - down) / fov) * model.rows
    column = np.clip(np.floor(u), 0, model.columns - 1).astype(np.int32)
    row = np.clip(np.floor(v), 0, model.rows - 1).astype(np.int32)
    pixel = row * model.columns + column
    # The last one written stays: the nearest.
    order = np.argsort(-depth, kind="stable")
    point = np.full(model.rows * model.columns, -1, np.int32)
    point[pixel[order]] = order
    seen = point >= 0
    chosen = point[seen]
    channels = np.zeros((5, point.size), np.float32)
    for channel, values in zip(channels, (depth, x, y, z, remission)):
        channel[seen] = values[chosen]
    shape = (model.rows, model.columns)
    return RangeImage(channels.reshape(5, *shape), point.reshape(shape), pixel)


# Rows above and below a pixel among which its neighbours are sought.
SLOPE_REACH = 3


def _nearest_in_column(values: np.ndarray, seen: np.ndarray, step: int) -> np.ndarray:
    """Of each pixel's next seen ones in its column, at most SLOPE_REACH rows away, above (step -1) or
    below (1); the pixel itself where there is none. `values`: k x rows x columns."""
    found = values.copy()
    rows = seen.shape[0]
    for distance in range(min(SLOPE_REACH, rows - 1), 0, -1):
        here, there = slice(0, rows - distance), slice(distance, rows)
        if step < 0:
            here, there = there, here
        found[:, here] = np.where(seen[there], values[:, there], found[:, here])
    return found


def slope_rad(channels: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Angle of the surface above the horizontal, along the column: 0 on level ground, pi / 2 on a
    wall, more under an overhang; 0 where the column shows nothing else nearby.

    `channels`: of a range image; `seen`: mask of its pixels with a point."""
    _, x, y, z = channels[:4]
    profile = np.stack([np.sqrt(x * x + y * y), z])
    above = _nearest_in_column(profile, seen, -1)
    below = _nearest_in_column(profile, seen, 1)
    away, up = above - below
    return np.arctan2(up, away) * seen


def normalise(image: RangeImage, mean: Sequence[float], deviation: Sequence[float]) -> np.ndarray:
    """(value - mean) / deviation, and 0 in all channels of an empty pixel. Six of each: the sixth
    channel is the slope."""
    mean = np.asarray(mean, np.float32)[:, None, None]
    deviation = np.asarray(deviation, np.float32)[:, None, None]
    seen = image.point >= 0
    channels = image.channels
    if len(mean) > len(channels):
        channels = np.concatenate([channels, slope_rad(channels, seen)[None]])
    return (channels - mean) / deviation * seen
