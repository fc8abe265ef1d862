#!/usr/bin/env python3
"""Fits the last decoder stage and the head of a trained light network to few scans, in minutes on one
processor core: all that comes before them is computed once for each scan, and stays as it is.

  tune_last_stage.py training.yaml runs/tuned --set start_from=config/models/street \\
      --set data.train=[kitti,data/training] --set data.validation=[kitti] ...

Takes each scan of data.train as it is and once augmented (see training.yaml: mix_scans, paste_objects),
and of both small pieces of the image about pixels, as many of rare classes as of others. The result is
the mean of the fitted weights (--keep: the share of the old ones) with those it started from, which is
better on scans of other places than the fitted weights (WiSE-FT: Wortsman et al., CVPR 2022). Writes
best.pt, which export.py exports.
"""

import argparse
import copy
import math
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional

from networks import LightRangeNet, activate
from samples import TrainingSamples, plain_sample
from scans import IGNORED
from train import Run, precision, read_config, write_whole

# Pieces of an image about pixels drawn uniformly, and about pixels of each class there.
ANYWHERE, OF_EACH_CLASS = 250, 60


def before_last_stage(network, image):
    """Inputs of the last decoder stage: those of the stage before, and the skip."""
    x = activate(network.bn1(network.conv1(image)))
    skips = []
    for stage in network.encoder:
        skips.append(x)
        x = stage(x)
    for stage, skip in list(zip(network.decoder, reversed(skips)))[:-1]:
        x = stage(x, skip)
    return x[0].float().numpy(), skips[0][0].float().numpy()


def chosen_pixels(classes, random):
    """Indices into the labelled `classes`, balanced, and how much more often each class is in the
    image than among them."""
    picked = [random.choice(len(classes), min(ANYWHERE, len(classes)), replace=False)]
    for label in np.unique(classes):
        members = np.flatnonzero(classes == label)
        picked.append(random.permutation(members)[:OF_EACH_CLASS])
    picked = np.concatenate(picked)
    there = np.bincount(classes, minlength=256) / len(classes)
    taken = np.bincount(classes[picked], minlength=256) / len(picked)
    return picked, (there / np.maximum(taken, 1e-9))[classes[picked]]


def pieces(features, skip, target, random):
    """Cuts 3 x 3 features and 3 x 6 of the skip about chosen pixels. Four columns of `target` stand
    over one of the features; the middle piece gives the first two of them."""
    pairs = np.stack([target[:, 0::4], target[:, 1::4]], -1)
    rows, columns = np.nonzero((pairs != IGNORED).any(-1))
    labels = pairs[rows, columns]
    known = np.where(labels[:, 0] != IGNORED, labels[:, 0], labels[:, 1])
    picked, weights = chosen_pixels(known, random)
    rows, columns = rows[picked, None, None], columns[picked, None, None]
    cut = []
    for values, first, width in ((features, columns - 1, 3), (skip, 2 * columns - 2, 6)):
        padded = np.pad(values, ((0, 0), (1, 1), (0, 0)))
        place = (first + np.arange(width)) % values.shape[2]
        part = padded[:, rows + np.arange(3)[None, :, None], place]
        cut.append(part.transpose(1, 0, 2, 3).astype(np.float16))
    return [*cut, labels[picked], weights.astype(np.float32)]


def images_of(run):
    """(index, input, classes) of each training scan as it is, and once augmented."""
    config = copy.deepcopy(run.config)
    columns = config["image"]["columns"]
    config["augmentation"].update(crop_columns=columns, image_columns=[columns])
    samples = TrainingSamples(run.scans, config)
    for index in range(len(run.scans)):
        yield index, *plain_sample(run.scans, index, config)
        channels, target = samples[index, config["seed"] + index]
        yield index, channels.numpy(), target.numpy()


def collect(run):
    """Pieces of all images, by folder of data.train."""
    network, random = run.averaged, np.random.default_rng(run.config["seed"])
    found = [[] for _ in run.config["data"]["train"]]
    for index, channels, target in images_of(run):
        image = torch.from_numpy(channels)[None].to(memory_format=torch.channels_last)
        with torch.no_grad(), precision(run.config, "cpu"):
            parts = before_last_stage(network, image)
        found[run.scans.folder[index]].append(pieces(*parts, target, random))
    return [[np.concatenate(values) for values in zip(*folder)] for folder in found if folder]


def draw(collected, batch, shares, random):
    parts = []
    for folder, share in zip(collected, shares):
        chosen = random.integers(0, len(folder[2]), max(1, round(batch * share)))
        parts.append([values[chosen] for values in folder])
    features, skip, labels, weights = (np.concatenate(values) for values in zip(*parts))
    images = [
        torch.from_numpy(values.astype(np.float32)).to(memory_format=torch.channels_last)
        for values in (features, skip)
    ]
    return images, torch.from_numpy(labels.astype(np.int64)), torch.from_numpy(weights)


def fit(network, collected, shares, arguments):
    """Fits the last stage and the head; the result is a running mean over some 150 steps."""
    stage, head = network.decoder[-1], network.head
    fitted = [*stage.parameters(), *head.parameters()]
    first = [p.detach().clone() for p in fitted]
    mean = [p.detach().clone() for p in fitted]
    optimiser = torch.optim.Adam(fitted, arguments.rate)
    random = np.random.default_rng(1)
    for step in range(arguments.steps):
        falling = 0.5 * (1 + math.cos(math.pi * step / arguments.steps))
        optimiser.param_groups[0]["lr"] = arguments.rate * min(1, (step + 1) / 20) * falling
        images, labels, weights = draw(collected, arguments.batch, shares, random)
        scores = head(stage(*images))[:, :, 1, 4:6]
        each = functional.cross_entropy(scores, labels, ignore_index=IGNORED, reduction="none")
        counted = (labels != IGNORED) * weights.sqrt()[:, None]
        loss = (each * counted).sum() / counted.sum()
        moved = sum(((p - q) ** 2).sum() for p, q in zip(fitted, first))
        optimiser.zero_grad()
        (loss + arguments.stay * moved).backward()
        optimiser.step()
        with torch.no_grad():
            for average, p in zip(mean, fitted):
                average.lerp_(p, 1 / min(150, 1 + step / 3))
        if (step + 1) % 100 == 0:
            print(f"step {step + 1}/{arguments.steps}: loss {loss.item():.3f}", flush=True)
    with torch.no_grad():
        for p, average, old in zip(fitted, mean, first):
            p.copy_(average.lerp(old, arguments.keep))


def read_arguments():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("config", help="such as training.yaml beside this file")
    parser.add_argument("folder", type=Path, help="of the run; gets best.pt")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--shares", type=float, nargs="+", help="of each folder; default: equal")
    parser.add_argument("--steps", type=int, default=900)
    parser.add_argument("--batch", type=int, default=384, help="pieces in a step")
    parser.add_argument("--rate", type=float, default=0.0015)
    parser.add_argument("--stay", type=float, default=0.005, help="weight of staying at the start")
    parser.add_argument("--keep", type=float, default=0.4, help="share of the old weights, 0..1")
    return parser.parse_args()


def main():
    arguments = read_arguments()
    config = read_config(arguments.config, arguments.set)
    torch.set_num_threads(config["threads"])
    arguments.folder.mkdir(parents=True, exist_ok=True)
    run = Run(config, arguments.folder, "cpu")
    if not isinstance(run.network, LightRangeNet) or not config["start_from"]:
        raise SystemExit("network.kind must be light, and start_from name what to start from")
    run.start_from(config["start_from"])
    before = run.validate()
    print(f"before: validation mIoU {100 * before.mean_iou():.1f}\n  {before.table()}", flush=True)
    collected = collect(run)
    shares = np.array(arguments.shares or [1] * len(collected), float)
    if len(shares) != len(collected):
        raise SystemExit(f"--shares has {len(shares)} numbers, data.train {len(collected)} folders")
    fit(run.averaged, collected, shares / shares.sum(), arguments)
    after = run.validate()
    print(f"after: validation mIoU {100 * after.mean_iou():.1f}\n  {after.table()}")
    history = [{"epoch": 1, "loss": math.nan, "miou": after.mean_iou()}]
    state = {"config": config, "trained_for": run.scans.trained_for(), "epoch": 1}
    state = {**state, "averaged": run.averaged.state_dict(), "history": history}
    write_whole(state, arguments.folder / "best.pt")


if __name__ == "__main__":
    main()
