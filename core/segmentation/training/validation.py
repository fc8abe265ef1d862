"""Validation of a training run: IoU, learning curves, range images with their classes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib

matplotlib.use("Agg")

import numpy as np
import torch
from matplotlib import pyplot

from samples import plain_sample
from scans import CLASS_COLOURS, CLASS_NAMES, IGNORED

if TYPE_CHECKING:
    from train import Run


class Confusion:
    """Counts of (truth, prediction) pairs, as semantic-kitti-api counts them; pixels without truth
    are left out."""

    def __init__(self, classes: int = len(CLASS_NAMES)) -> None:
        self.counts = np.zeros((classes, classes), np.int64)

    def add(self, truth: np.ndarray, prediction: np.ndarray) -> None:
        known = truth != IGNORED
        pairs = truth[known].astype(np.int64) * len(self.counts) + prediction[known]
        self.counts += np.bincount(pairs, minlength=self.counts.size).reshape(self.counts.shape)

    def iou(self) -> np.ndarray:
        """Intersection over union per class; NaN for classes that are not in the truth."""
        hits = np.diag(self.counts).astype(float)
        union = self.counts.sum(0) + self.counts.sum(1) - hits
        iou = np.where(self.counts.sum(1) > 0, hits / np.maximum(union, 1), np.nan)
        iou[IGNORED] = np.nan
        return iou

    def mean_iou(self) -> float:
        return float(np.nanmean(self.iou()))

    def table(self) -> str:
        return "  ".join(
            f"{name} {100 * value:.1f}"
            for name, value in zip(CLASS_NAMES, self.iou())
            if not np.isnan(value)
        )


def save_curves(history: list[dict[str, float]], file: Path) -> None:
    epochs = [entry["epoch"] for entry in history]
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(10, 4))
    left.plot(epochs, [entry["loss"] for entry in history])
    left.set(xlabel="epoch", ylabel="training loss")
    right.plot(epochs, [100 * entry["miou"] for entry in history])
    right.set(xlabel="epoch", ylabel="validation mIoU [%]")
    figure.tight_layout()
    figure.savefig(file)
    pyplot.close(figure)


def labelled_image(channels: np.ndarray, target: np.ndarray, classes: np.ndarray) -> np.ndarray:
    """Remission, truth and prediction, one above the other; each row twice as high."""
    level = np.clip(0.5 + 0.4 * channels[4], 0, 1) * (channels[0] != 0)
    grey = np.repeat((255 * level).astype(np.uint8)[:, :, None], 3, axis=2)
    found = CLASS_COLOURS[classes] * (channels[0] != 0)[:, :, None]
    return np.repeat(np.concatenate([grey, CLASS_COLOURS[target], found]), 2, axis=0)


def save_labelled_images(run: Run, count: int = 3) -> None:
    """labels_N.png of a few validation scans."""
    for number in range(count):
        index = (2 * number + 1) * len(run.validation) // (2 * count)
        channels, target = plain_sample(run.validation, index, run.config)
        with torch.no_grad():
            scores = run.averaged(torch.from_numpy(channels)[None].to(run.device))
        classes = scores.argmax(1)[0].cpu().numpy()
        picture = labelled_image(channels, target, classes)
        pyplot.imsave(run.folder / f"labels_{number}.png", picture)
