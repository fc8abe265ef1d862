#!/usr/bin/env python3
"""Takes back a share of what a training's class weights did to how often each class is found.

  adjust_prior.py config/models/mine adjusted --data data/training --share 0.5

A loss that weighs rare classes more makes a network find them more often than they are: a part of
the road becomes parking. From the score of each class, `share` times the logarithm of its weight is
subtracted (logit adjustment: Menon et al., ICLR 2021), in the bias of the last layer. The weights are
those of --weights (see training.yaml) for the classes of --data. model.yaml is copied as it is, and
so is int8.yaml, but for its network_crc32: the last layer runs in floating point, and its input stays
the same.
"""

import argparse
import shutil
import zlib
from pathlib import Path

import numpy as np
import onnx
from onnx import numpy_helper

from losses import class_weights
from range_images import ImageModel
from scans import IGNORED, ScanFiles


def offsets(shares: np.ndarray, kind: str, share: float) -> np.ndarray:
    """What to subtract from the score of each class; nothing from the ignored class."""
    logs = np.log(np.maximum(class_weights(shares, kind).numpy(), 1e-6))
    logs -= np.delete(logs, IGNORED).min()
    logs[IGNORED] = 0
    return (share * logs).astype(np.float32)


def last_bias(graph: onnx.GraphProto) -> onnx.TensorProto:
    """The initializer that is the bias of the network's last convolution."""
    last = [n for n in graph.node if n.op_type in ("Conv", "ConvTranspose")][-1]
    if len(last.input) < 3:
        raise SystemExit(f"{last.name} has no bias to change")
    name = last.input[2]
    for node in graph.node:
        # Equal tensors are stored once.
        if node.op_type == "Identity" and node.output[0] == name:
            name = node.input[0]
    return next(tensor for tensor in graph.initializer if tensor.name == name)


def crc32_of(file: Path) -> str:
    """As Stillmap writes it to int8.yaml."""
    return f"{zlib.crc32(file.read_bytes()):08x}"


def adjust(source: Path, target: Path, change: np.ndarray) -> None:
    """Writes the model `source` to the folder `target`, with `change` subtracted from its scores."""
    network = onnx.load(str(source / "model.onnx"))
    bias = last_bias(network.graph)
    values = numpy_helper.to_array(bias)
    if values.shape != change.shape:
        raise SystemExit(f"{source}: has {values.size} classes, the training {change.size}")
    bias.CopyFrom(numpy_helper.from_array(values - change, bias.name))
    target.mkdir(parents=True, exist_ok=True)
    crc32 = crc32_of(source / "model.onnx")
    onnx.save(network, str(target / "model.onnx"))
    for name in ("model.yaml", "int8.yaml"):
        if (source / name).exists() and source.resolve() != target.resolve():
            shutil.copy(source / name, target / name)
    calibration = target / "int8.yaml"
    if calibration.exists():
        # It belongs to this network as it did to the other.
        text = calibration.read_text()
        calibration.write_text(text.replace(crc32, crc32_of(target / "model.onnx"), 1))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("model", type=Path)
    parser.add_argument("folder", type=Path, help="of the model to write")
    parser.add_argument("--data", nargs="+", required=True, help="folders of the training scans")
    parser.add_argument("--weights", default="log", help="loss.weights of the training")
    parser.add_argument("--share", type=float, default=0.5)
    arguments = parser.parse_args()
    scans = ScanFiles(arguments.data, [], ImageModel(64, 2048, 3, -25))
    change = offsets(scans.class_shares(), arguments.weights, arguments.share)
    adjust(arguments.model, arguments.folder, change)


if __name__ == "__main__":
    main()
