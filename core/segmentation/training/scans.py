"""SemanticKITTI folders as a training set: scans, their classes, their sensors."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from range_images import ImageModel, elevation_rad

# Points (n x 3, lidar frame [m]), remission (n) and classes (n).
Scan = tuple[np.ndarray, np.ndarray, np.ndarray]

IGNORED = 0

# More of a scan's points beyond the rows of its image, where they crowd into the first and the last
# one: another lidar's. KITTI's has about 1 % there.
MOST_OUTSIDE = 0.1

# learning_map of the single-scan task: original id to network class.
CLASS_OF_ID = {
    10: 1, 252: 1, 11: 2, 15: 3, 18: 4, 258: 4, 13: 5, 16: 5, 20: 5, 256: 5, 257: 5, 259: 5,
    30: 6, 254: 6, 31: 7, 253: 7, 32: 8, 255: 8, 40: 9, 60: 9, 44: 10, 48: 11, 49: 12, 50: 13,
    51: 14, 70: 15, 71: 16, 72: 17, 80: 18, 81: 19,
}  # fmt: skip

CLASS_NAMES = (
    "unlabeled car bicycle motorcycle truck other-vehicle person bicyclist motorcyclist road "
    "parking sidewalk other-ground building fence vegetation trunk terrain pole traffic-sign"
).split()

CLASS_COLOURS = np.array(
    [
        (0, 0, 0), (100, 150, 245), (100, 230, 245), (30, 60, 150), (80, 30, 180), (0, 0, 255),
        (255, 30, 30), (255, 40, 200), (150, 30, 90), (255, 0, 255), (255, 150, 255), (75, 0, 75),
        (175, 0, 75), (255, 200, 0), (255, 120, 50), (0, 175, 0), (135, 60, 0), (150, 240, 80),
        (255, 240, 150), (255, 0, 0),
    ],
    np.uint8,
)  # fmt: skip

_CLASSES = np.zeros(65536, np.uint8)
for _id, _class in CLASS_OF_ID.items():
    _CLASSES[_id] = _class


def classes_of(raw_labels: np.ndarray) -> np.ndarray:
    """Network classes of raw labels (instance id in the high 16 bits)."""
    return _CLASSES[raw_labels & 0xFFFF]


# A lidar of so few beams fires some 1800 times per revolution: columns beyond are empty.
FEW_BEAMS, COLUMNS_OF_FEW_BEAMS = 16, 1536


def _beams_by_step(sensor: dict[str, Any], usual_rows: int) -> float:
    """Beams that evenly spaced ones would be if they lay as close as most of the sensor's do."""
    rings, beams = int(sensor["rings"]), sensor.get("beam_elevations_deg") or []
    if len(beams) < 2:
        return rings
    step = np.sort(-np.diff(beams))[(len(beams) - 1) // 2]
    return max(rings, min((sensor["fov_up_deg"] - sensor["fov_down_deg"]) / step, usual_rows))


def image_rows(sensor: dict[str, Any], usual_rows: int) -> int:
    """Rows of the image of an upright lidar, as the engine chooses them (for_sensor() in
    model_description.cpp): `sensor` as in sensor.yaml, `usual_rows` of the model."""
    rings = rows = int(sensor["rings"])
    if sensor.get("pattern", "rings") != "irregular":
        rows = min(0.5 * (_beams_by_step(sensor, usual_rows) + usual_rows), 2 * rings)
    return max(1, int(min(rows, 2 * usual_rows) / 8 + 0.5)) * 8


def image_columns(image: ImageModel, columns: int) -> int:
    """As many of `columns` as a lidar of its beams fills."""
    return min(columns, COLUMNS_OF_FEW_BEAMS) if image.beams <= FEW_BEAMS else columns


def sensor_image(sequence: Path, default: ImageModel) -> ImageModel:
    """The range image of a sequence: of its sensor.yaml's rings and field of view, in as many rows
    and columns as the engine gives it, or `default`."""
    file = sequence / "sensor.yaml"
    if not file.exists():
        return default
    sensor = yaml.safe_load(file.read_text())
    rows, rings = image_rows(sensor, default.rows), int(sensor["rings"])
    edges = sensor["fov_up_deg"], sensor["fov_down_deg"]
    image = ImageModel(rows, default.columns, *edges, rings)
    return replace(image, columns=image_columns(image, default.columns))


def share_outside(points: np.ndarray, image: ImageModel) -> float:
    """Share of the points (n x 3) above or below the image's field of view."""
    elevation_deg = np.degrees(elevation_rad(points.astype(np.float64)))
    outside = (elevation_deg > image.fov_up_deg) | (elevation_deg < image.fov_down_deg)
    return float(outside.mean()) if len(points) else 0.0


class ScanFiles:
    """The labelled scans of one or more SemanticKITTI folders."""

    def __init__(
        self, folders: Sequence[str | Path], sequences: Sequence[str], default_image: ImageModel
    ) -> None:
        """`folder` holds each scan's place in `folders`."""
        self.files, self.images, self.folder = [], [], []
        for place, folder in enumerate(map(Path, folders)):
            for sequence in sorted((folder / "sequences").iterdir()):
                # A name with a suffix is a sequence that is still being written.
                if sequence.suffix or (sequences and sequence.name not in sequences):
                    continue
                image = sensor_image(sequence, default_image)
                for scan in sorted((sequence / "velodyne").glob("*.bin")):
                    label = sequence / "labels" / (scan.stem + ".label")
                    if label.exists():
                        self.files.append((scan, label))
                        self.images.append(image)
                        self.folder.append(place)
        if not self.files:
            raise FileNotFoundError(f"no labelled scan in {folders} (sequences: {sequences or 'all'})")

    def __len__(self) -> int:
        return len(self.files)

    def read(self, index: int) -> Scan:
        """Points (n x 3), remission (n) and class (n), without points that cannot be projected."""
        return self.read_instances(index)[:3]

    def read_instances(self, index: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """As `read`, and the instance id (n) of each point, 0 where it has none."""
        scan_file, label_file = self.files[index]
        scan = np.fromfile(scan_file, np.float32)
        labels = np.fromfile(label_file, np.uint32)
        if scan.size != 4 * labels.size:
            raise ValueError(f"{label_file}: {labels.size} labels for {scan.size / 4} points")
        scan = scan.reshape(-1, 4)
        usable = np.isfinite(scan).all(axis=1) & (np.abs(scan[:, :3]).max(axis=1) > 1e-3)
        scan = scan[usable]
        labels = labels[usable]
        return scan[:, :3], scan[:, 3], classes_of(labels), labels >> 16

    def require_field_of_view(self) -> None:
        """Raises ValueError where sequences without a sensor.yaml are not of the lidar that the
        configuration's `image` describes, by the first scan of each."""
        looked_at = set()
        for index, (scan, _) in enumerate(self.files):
            sequence = scan.parent.parent
            if sequence in looked_at or (sequence / "sensor.yaml").exists():
                continue
            looked_at.add(sequence)
            image = self.images[index]
            share = share_outside(self.read(index)[0], image)
            if share > MOST_OUTSIDE:
                raise ValueError(
                    f"{sequence} has no sensor.yaml, and {share:.0%} of the points of {scan.name} lie "
                    f"outside {image.fov_up_deg:+g} to {image.fov_down_deg:+g} degrees, the field of "
                    f"view of 'image' in the configuration: write it with 'stillmap dataset sensor "
                    f"{sequence} --out {sequence}/sensor.yaml', or set image.rows, image.fov_up_deg "
                    f"and image.fov_down_deg"
                )

    def evenly_chosen(self, most: int) -> Iterator[int]:
        """Indices of at most about `most` scans, as many of each folder as there are."""
        folder = np.array(self.folder)
        places = np.unique(folder)
        for place in places:
            members = np.flatnonzero(folder == place)
            wanted = min(len(members), -(-most // len(places)))
            yield from members[np.linspace(0, len(members) - 1, wanted).astype(int)]

    def trained_for(self) -> dict[str, float]:
        """The lidars of the scans, as model.yaml tells them: fewest and most beams, and the field of
        view [degrees] that holds all of theirs."""
        return {
            "min_beams": min(int(image.beams) for image in self.images),
            "max_beams": max(int(image.beams) for image in self.images),
            "fov_up_deg": max(float(image.fov_up_deg) for image in self.images),
            "fov_down_deg": min(float(image.fov_down_deg) for image in self.images),
        }

    def class_shares(self, scans: int = 200) -> np.ndarray:
        """Share of every class among all points, from scans spread evenly over each folder."""
        counts = np.zeros(len(CLASS_NAMES))
        for index in self.evenly_chosen(scans):
            counts += np.bincount(self.read(index)[2], minlength=counts.size)
        return counts / counts.sum()
