#!/usr/bin/env python3
"""Measures a training on sequences that it has not seen: leaves some out, trains on the others,
and scores those left out; then the next ones.

  leave_out.py training.yaml runs/leave_out --folds 00+04+07,01+02+03,06+09 --set data.train=[kitti]

The sequences of a fold are joined by +. Sequences that no fold names, such as simulated ones, are
always trained on. Each fold has a run of train.py in the folder, and resumes as that does. The last
weights are scored, not those that did best on the sequences left out.
"""

import argparse
import copy
from pathlib import Path
from typing import Any

import numpy as np
import torch

from range_images import ImageModel
from scans import CLASS_NAMES, ScanFiles
from train import Run, read_config, train
from validation import Confusion


def sequences_of(config: dict[str, Any]) -> list[str]:
    """Names of all sequences of the training folders, or of those that the configuration lists."""
    data = config["data"]
    image = ImageModel(**config["image"])
    scans = ScanFiles(data["train"], data["train_sequences"], image)
    return sorted({scan.parent.parent.name for scan, _ in scans.files})


def fold_config(config: dict[str, Any], left_out: list[str], every: list[str]) -> dict[str, Any]:
    """The configuration that trains on all sequences of `every` but those left out."""
    unknown = set(left_out) - set(every)
    if unknown:
        raise SystemExit(f"--folds: there is no sequence {', '.join(sorted(unknown))} to leave out")
    changed = copy.deepcopy(config)
    data = changed["data"]
    data["train_sequences"] = [name for name in every if name not in left_out]
    data["validation"], data["validation_sequences"] = data["train"], left_out
    return changed


def score_left_out(config: dict[str, Any], folder: Path, device: str) -> Confusion:
    """Trains, and counts every scan of the sequences left out."""
    run = Run(config, folder, device)
    train(run)
    run.config["data"]["validation_scans"] = len(run.validation)
    return run.validate()


def show(name: str, confusion: Confusion) -> None:
    print(f"{name}: mean IoU of the classes there {100 * confusion.mean_iou():.1f}")
    print("  " + confusion.table(), flush=True)


def read_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("config", help="such as training.yaml beside this file")
    parser.add_argument("folder", type=Path, help="of the runs, one a fold")
    parser.add_argument("--folds", help="default: each sequence of data.train by itself")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    return parser.parse_args()


def main() -> None:
    arguments = read_arguments()
    config = read_config(arguments.config, arguments.set)
    torch.set_num_threads(config["threads"])
    every = sequences_of(config)
    folds = [fold.split("+") for fold in arguments.folds.split(",")] if arguments.folds else None
    together = Confusion()
    for left_out in folds or [[name] for name in every]:
        name = "+".join(left_out)
        changed = fold_config(config, left_out, every)
        confusion = score_left_out(changed, arguments.folder / name, arguments.device)
        show(name, confusion)
        together.counts += confusion.counts
    show("all that were left out", together)
    np.savetxt(
        arguments.folder / "confusion.csv",
        together.counts,
        fmt="%d",
        delimiter=",",
        header=",".join(CLASS_NAMES),
    )


if __name__ == "__main__":
    main()
