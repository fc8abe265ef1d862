"""PNGs of a training run: its curves, and range images with the classes found and true."""

import matplotlib

matplotlib.use("Agg")

import numpy as np
import torch
from matplotlib import pyplot

from samples import plain_sample
from scans import CLASS_COLOURS


def save_curves(history, file):
    epochs = [entry["epoch"] for entry in history]
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(10, 4))
    left.plot(epochs, [entry["loss"] for entry in history])
    left.set(xlabel="epoch", ylabel="training loss")
    right.plot(epochs, [100 * entry["miou"] for entry in history])
    right.set(xlabel="epoch", ylabel="validation mIoU [%]")
    figure.tight_layout()
    figure.savefig(file)
    pyplot.close(figure)


def labelled_image(channels, target, classes):
    """Remission, truth and prediction, one above the other; each row twice as high."""
    level = np.clip(0.5 + 0.4 * channels[4], 0, 1) * (channels[0] != 0)
    grey = np.repeat((255 * level).astype(np.uint8)[:, :, None], 3, axis=2)
    found = CLASS_COLOURS[classes] * (channels[0] != 0)[:, :, None]
    return np.repeat(np.concatenate([grey, CLASS_COLOURS[target], found]), 2, axis=0)


def save_labelled_images(run, count=3):
    """labels_N.png of a few validation scans."""
    for number in range(count):
        index = (2 * number + 1) * len(run.validation) // (2 * count)
        channels, target = plain_sample(run.validation, index, run.config)
        with torch.no_grad():
            scores = run.averaged(torch.from_numpy(channels)[None].to(run.device))
        classes = scores.argmax(1)[0].cpu().numpy()
        picture = labelled_image(channels, target, classes)
        pyplot.imsave(run.folder / f"labels_{number}.png", picture)
