"""Training and validation samples, and batches of them."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import torch

from augmentation import aim, augment_points, crop, draw_motion, drop_beams, in_sector
from mixing import Objects, mix_bands, mix_sectors, turned
from range_images import ImageModel, RangeImage, normalise, project
from scans import IGNORED, Scan, ScanFiles, image_columns

# Keys of TrainingSamples.
Batch = list[tuple[int, int]]


def open_scans(config: dict[str, Any], part: str) -> ScanFiles:
    data = config["data"]
    default = ImageModel(**config["image"])
    return ScanFiles(data[part], data[f"{part}_sequences"], default)


def _target(image: RangeImage, classes: np.ndarray) -> np.ndarray:
    target = np.full(image.point.shape, IGNORED, np.int64)
    seen = image.point >= 0
    target[seen] = classes[image.point[seen]]
    return target


def _network_input(
    image: RangeImage, remission: np.ndarray | None, config: dict[str, Any]
) -> np.ndarray:
    channels = normalise(image, config["mean"], config["deviation"])
    if remission is None:
        channels[4] = 0
    return channels


def plain_sample(
    scans: ScanFiles, index: int, config: dict[str, Any]
) -> tuple[np.ndarray, np.ndarray]:
    """Input (5 x rows x columns) and classes (rows x columns) of a scan, without augmentation."""
    points, remission, classes = scans.read(index)
    image = project(points, remission, scans.images[index])
    return _network_input(image, remission, config), _target(image, classes)


def _drawn_width(
    image: ImageModel, settings: dict[str, Any], random: np.random.Generator
) -> ImageModel:
    widths = settings.get("image_columns")
    if not widths:
        return image
    return replace(image, columns=image_columns(image, int(random.choice(widths))))


# Tilting changes azimuths, mostly by less than this.
MARGIN_RAD = np.radians(4)


def _part(
    scan: Scan,
    model: ImageModel,
    settings: dict[str, Any],
    motion: np.ndarray,
    random: np.random.Generator,
) -> tuple[Scan, float]:
    """The sector of a scan that a crop can show (to save time), and the azimuth of the crop's
    middle after the motion."""
    points, _, classes = scan
    width_rad = 2 * np.pi * settings["crop_columns"] / model.columns
    middle_rad = aim(points, classes, width_rad, settings.get("aim_at_classes", 0), random)
    chosen = in_sector(points, middle_rad, width_rad + 2 * MARGIN_RAD)
    x, y, _ = np.array([np.cos(middle_rad), np.sin(middle_rad), 0], np.float32) @ motion
    return tuple(values[chosen] for values in scan), np.arctan2(y, x)


class TrainingSamples(torch.utils.data.Dataset):
    """Augmented crops of range images, drawn anew for every key (index, seed)."""

    def __init__(self, scans: ScanFiles, config: dict[str, Any]) -> None:
        self.scans, self.config = scans, config
        self.settings = config["augmentation"]
        self.mix_share = self.settings.get("mix_scans", 0)
        self.paste_share = self.settings.get("paste_objects", 0)
        self.objects = Objects(scans) if self.paste_share else None
        self.beams = np.array([image.beams for image in scans.images])

    def __len__(self) -> int:
        return len(self.scans)

    def __getitem__(self, key: tuple[int, int]) -> tuple[torch.Tensor, torch.Tensor]:
        index, seed = key
        random = np.random.default_rng(seed)
        settings = self.settings
        model = _drawn_width(self.scans.images[index], settings, random)
        scan, azimuth_rad = self._augmented(index, model, random)
        points, remission, classes = self._mixed(scan, azimuth_rad, model, random)
        image = project(points, remission, model)
        drop_beams(image, model.beams, settings, random)
        known = None if random.random() < settings["remission_dropout"] else remission
        channels = _network_input(image, known, self.config)
        columns = settings["crop_columns"]
        channels, target = crop(channels, _target(image, classes), columns, azimuth_rad)
        return torch.from_numpy(channels), torch.from_numpy(target)

    def _augmented(
        self, index: int, model: ImageModel, random: np.random.Generator
    ) -> tuple[Scan, float]:
        """A sector of a scan, augmented, and the azimuth of its middle."""
        motion = draw_motion(self.settings, random)
        scan, azimuth_rad = _part(self.scans.read(index), model, self.settings, motion, random)
        return augment_points(*scan, motion, self.settings, random), azimuth_rad

    def _mixed(
        self, scan: Scan, azimuth_rad: float, model: ImageModel, random: np.random.Generator
    ) -> Scan:
        """The sector, perhaps with a part of another scan's, and with objects of others."""
        width_rad = 2 * np.pi * self.settings["crop_columns"] / model.columns
        if random.random() < self.mix_share:
            other, other_rad = self._augmented(self._another(model.beams, random), model, random)
            other = (turned(other[0], azimuth_rad - other_rad), *other[1:])
            if random.random() < 0.5:
                scan = mix_sectors(scan, other, azimuth_rad, width_rad, random)
            else:
                scan = mix_bands(scan, other, model, random)
        if random.random() < self.paste_share:
            for _ in range(random.integers(1, 4)):
                scan = self.objects.set_into(scan, azimuth_rad, width_rad, random)
        return scan

    def _another(self, beams: int, random: np.random.Generator) -> int:
        """A scan of a sensor with as many beams, of each folder as often as of the others."""
        alike = np.flatnonzero(self.beams == beams)
        folders = np.array(self.scans.folder)[alike]
        return random.choice(alike[folders == random.choice(np.unique(folders))])


def _spread_draws(members: np.ndarray, count: int, random: np.random.Generator) -> np.ndarray:
    """`count` of `members`, each as often as the others, give or take one."""
    whole, rest = divmod(count, len(members))
    return np.concatenate([np.tile(members, whole), random.permutation(members)[:rest]])


class BatchesBySensor(torch.utils.data.Sampler):
    """Batches in random order, each of scans with the same number of rows. The order and all
    random draws depend on the seed and the epoch alone, so that a resumed run is reproducible.

    `draws`: number of scans of each folder in an epoch; None: every scan once."""

    def __init__(
        self, scans: ScanFiles, batch: int, seed: int, draws: list[int] | None = None
    ) -> None:
        self.scans, self.batch, self.seed, self.epoch = scans, batch, seed, 0
        self.draws = draws

    def _drawn(self, random: np.random.Generator) -> np.ndarray:
        if not self.draws:
            return np.arange(len(self.scans))
        folder = np.array(self.scans.folder)
        return np.concatenate(
            [_spread_draws(np.flatnonzero(folder == k), n, random) for k, n in enumerate(self.draws)]
        )

    def batches(self) -> Iterator[Batch]:
        random = np.random.default_rng([self.seed, self.epoch])
        drawn = self._drawn(random)
        rows = np.array([self.scans.images[i].rows for i in drawn])
        for group in np.unique(rows):
            members = random.permutation(drawn[rows == group])
            if len(members) < self.batch:
                raise SystemExit(
                    f"{len(members)} scans have {group} rows, fewer than optimiser.batch = "
                    f"{self.batch}: add scans, draw them more often (data.train_draws), or lower it"
                )
            for begin in range(0, len(members) - self.batch + 1, self.batch):
                chosen = members[begin : begin + self.batch]
                yield [(int(i), int(random.integers(2**31))) for i in chosen]

    def __iter__(self) -> Iterator[Batch]:
        batches = list(self.batches())
        random = np.random.default_rng([self.seed, self.epoch, 1])
        random.shuffle(batches)
        return iter(batches)

    def __len__(self) -> int:
        return sum(1 for _ in self.batches())
