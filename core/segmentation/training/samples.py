"""Training and validation samples, and batches of them."""

from dataclasses import replace

import numpy as np
import torch

from augmentation import aim, augment_points, crop, draw_motion, drop_beams, in_sector
from range_images import ImageModel, normalise, project
from scans import IGNORED, ScanFiles


def open_scans(config, part):
    data = config["data"]
    default = ImageModel(**config["image"])
    return ScanFiles(data[part], data[f"{part}_sequences"], default)


def _target(image, classes):
    target = np.full(image.point.shape, IGNORED, np.int64)
    seen = image.point >= 0
    target[seen] = classes[image.point[seen]]
    return target


def _network_input(image, remission, config):
    channels = normalise(image, config["mean"], config["deviation"])
    if remission is None:
        channels[4] = 0
    return channels


def plain_sample(scans, index, config):
    """Input (5 x rows x columns) and classes (rows x columns) of a scan, without augmentation."""
    points, remission, classes = scans.read(index)
    image = project(points, remission, scans.images[index])
    return _network_input(image, remission, config), _target(image, classes)


def _drawn_width(image, settings, random):
    widths = settings.get("image_columns")
    return replace(image, columns=int(random.choice(widths))) if widths else image


# Tilting changes azimuths, mostly by less than this.
MARGIN_RAD = np.radians(4)


def _part(scan, model, settings, motion, random):
    """The sector of a scan that a crop can show (to save time), and the azimuth of the crop's
    middle after the motion."""
    points, _, classes = scan
    width_rad = 2 * np.pi * settings["crop_columns"] / model.columns
    middle_rad = aim(points, classes, width_rad, settings.get("aim_at_classes", 0), random)
    chosen = in_sector(points, middle_rad, width_rad + 2 * MARGIN_RAD)
    x, y, _ = np.array([np.cos(middle_rad), np.sin(middle_rad), 0], np.float32) @ motion
    return [values[chosen] for values in scan], np.arctan2(y, x)


class TrainingSamples(torch.utils.data.Dataset):
    """Augmented crops of range images, drawn anew for every key (index, seed)."""

    def __init__(self, scans, config):
        self.scans, self.config = scans, config

    def __len__(self):
        return len(self.scans)

    def __getitem__(self, key):
        index, seed = key
        random = np.random.default_rng(seed)
        settings = self.config["augmentation"]
        model = _drawn_width(self.scans.images[index], settings, random)
        motion = draw_motion(settings, random)
        scan, azimuth_rad = _part(self.scans.read(index), model, settings, motion, random)
        points, remission, classes = augment_points(*scan, motion, settings, random)
        known = remission if remission is not None else np.zeros(len(points), np.float32)
        image = project(points, known, model)
        drop_beams(image, settings, random)
        channels = _network_input(image, remission, self.config)
        columns = settings["crop_columns"]
        channels, target = crop(channels, _target(image, classes), columns, azimuth_rad)
        return torch.from_numpy(channels), torch.from_numpy(target)


class BatchesBySensor(torch.utils.data.Sampler):
    """Batches in random order, each of scans with the same number of rows. The order and all
    random draws depend on the seed and the epoch alone, so that a resumed run is reproducible."""

    def __init__(self, scans, batch, seed):
        self.scans, self.batch, self.seed, self.epoch = scans, batch, seed, 0

    def batches(self):
        random = np.random.default_rng([self.seed, self.epoch])
        rows = np.array([image.rows for image in self.scans.images])
        for group in np.unique(rows):
            members = random.permutation(np.flatnonzero(rows == group))
            for begin in range(0, len(members) - self.batch + 1, self.batch):
                chosen = members[begin : begin + self.batch]
                yield [(int(i), int(random.integers(2**31))) for i in chosen]

    def __iter__(self):
        batches = list(self.batches())
        random = np.random.default_rng([self.seed, self.epoch, 1])
        random.shuffle(batches)
        return iter(batches)

    def __len__(self):
        return sum(1 for _ in self.batches())
