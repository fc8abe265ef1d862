#!/usr/bin/env python3
"""Exports a training run as a model folder: model.onnx, model.yaml, int8.yaml.

  export.py runs/mine config/models/mine --calibrate data/validation/sequences/0001 ...

The program `stillmap` calibrates int8.yaml and runs the engines that are compared with PyTorch.
"""

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any

import torch
from torch import nn

from model_folder import (
    ProgramFault,
    check_engines,
    class_names,
    describe,
    random_images,
    run_stillmap,
    write_model,
)
from networks import make_network


def load_run(folder: Path, file: str = "best.pt") -> tuple[nn.Module, dict[str, Any]]:
    """The network of best.pt or last.pt, and the run's state."""
    state = torch.load(folder / file, map_location="cpu")
    config = state["config"]
    network = make_network(config["network"], len(class_names()), len(config["mean"]))
    network.load_state_dict(state["averaged"])
    return network.eval(), state


def trained_for(state: dict[str, Any]) -> dict[str, Any]:
    """The lidars whose scans the run saw; nothing of a run that an older trainer made."""
    return {"trained_for": state["trained_for"]} if "trained_for" in state else {}


def lidar_height(state: dict[str, Any]) -> dict[str, float]:
    """At which height they stood; nothing where nobody told."""
    height_m = state.get("lidar_height_m")
    return {} if height_m is None else {"lidar_height_m": float(height_m)}


def describe_run(arguments: argparse.Namespace, state: dict[str, Any]) -> dict[str, Any]:
    config = state["config"]
    image = {**config["image"]}
    if arguments.columns:
        image["columns"] = arguments.columns
    widths = config["augmentation"].get("image_columns")
    # A network whose image does not follow the sensor is exported for one size.
    if config["follow_sensor"] and widths and min(widths) < image["columns"]:
        image["min_columns"] = min(widths)
    best = max(entry["miou"] for entry in state["history"])
    words = {
        "name": arguments.name or arguments.folder.name,
        "licence": arguments.licence,
        "sensor": arguments.sensor,
        **trained_for(state),
        **lidar_height(state),
        "training": arguments.training or f"{state['epoch']} epochs; see config.yaml of the run",
        "accuracy": arguments.accuracy or f"validation mIoU {100 * best:.1f} % of pixels",
    }
    return describe(
        words,
        image,
        config["mean"],
        config["deviation"],
        class_names(),
        config["knn"],
        config["follow_sensor"],
        # A run from before there were any has none.
        config.get("voxel_votes"),
        config.get("unsure_votes"),
        config.get("island_votes"),
    )


def read_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("run", type=Path, help="folder of train.py")
    parser.add_argument("folder", type=Path, help="the model folder to write")
    parser.add_argument("--name", help="default: the folder's name")
    parser.add_argument("--columns", type=int, help="of its images, if not those of the run")
    parser.add_argument("--licence", default="MIT")
    parser.add_argument("--sensor", default="spinning lidars of 16 to 64 beams")
    parser.add_argument("--training", help="how it was trained, in words")
    parser.add_argument("--accuracy", help="how well it does, in words")
    parser.add_argument(
        "--last", action="store_true", help="the weights of last.pt, not those of best.pt"
    )
    parser.add_argument("--calibrate", nargs="*", default=[], help="sequences for int8.yaml")
    parser.add_argument("--stillmap", type=Path, default="build/release/bin/stillmap")
    arguments = parser.parse_args()
    if arguments.columns is not None and (arguments.columns < 32 or arguments.columns % 32):
        parser.error(f"--columns {arguments.columns} is no multiple of 32")
    return arguments


def calibrate_and_compare(
    arguments: argparse.Namespace, network: nn.Module, description: dict[str, Any]
) -> None:
    """Makes int8.yaml where sequences are given, and prints how engines and PyTorch agree."""
    engines = [("opencv", "fp32"), ("onednn", "fp32")]
    if arguments.calibrate:
        run_stillmap(
            arguments.stillmap, "model", "calibrate", arguments.folder, *arguments.calibrate
        )
        engines.append(("onednn", "int8"))
    image = description["image"]
    shape = len(description["statistics"]), image["rows"], image["columns"]
    images = random_images(2, shape)
    with tempfile.TemporaryDirectory() as scratch:
        check_engines(
            arguments.stillmap, arguments.folder, network, images, Path(scratch), engines
        )


def main() -> None:
    arguments = read_arguments()
    network, state = load_run(arguments.run, "last.pt" if arguments.last else "best.pt")
    description = describe_run(arguments, state)
    write_model(arguments.folder, network, description)
    try:
        calibrate_and_compare(arguments, network, description)
    except ProgramFault as fault:
        sys.exit(f"export: {fault}. {arguments.folder} is there, not compared with PyTorch")


if __name__ == "__main__":
    main()
