"""Initial weights of a training: another run's, or those of a model folder.

In a model.onnx the batch norms are folded into the convolutions. For further training they are
unfolded: each gets the mean and the variance of its convolution's output on training images, and
the scale and offset with which the network's output stays the same.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
import yaml
from onnx import numpy_helper
from torch import nn

from model_folder import CHANNELS, class_names

# Squared norm of a filter with PyTorch's random initialisation. Before a batch norm the norm of a
# filter does not change the output, but the effective learning rate: it falls with the norm.
SQUARED_LENGTH = 1 / 3


def check_description(file: str | Path, config: dict[str, Any]) -> None:
    """Raises ValueError when the model's normalisation or classes differ from the configuration."""
    file = Path(file)
    file = (file.parent if file.suffix == ".onnx" else file) / "model.yaml"
    if not file.exists():
        return
    model = yaml.safe_load(file.read_text())
    for field in ("mean", "deviation"):
        known = model["statistics"]
        # A model without the slope can be taught to see it.
        values = [known[channel][field] for channel in CHANNELS if channel in known]
        if not np.allclose(values, config[field][: len(values)]):
            raise ValueError(f"{file}: {field} is {values}, in this configuration {config[field]}")
    if list(model["classes"].values()) != class_names():
        raise ValueError(f"{file}: its classes are not those that are trained here")


def load_weights(network: nn.Module, file: str | Path, images: Iterable[torch.Tensor]) -> None:
    """Gives `network` the weights of `file`: best.pt of a run, or a model folder. `images`:
    iterable of training inputs (n x 5 x rows x columns), for the batch norms of a model folder."""
    file = Path(file)
    if file.is_dir():
        file = file / "model.onnx"
    if file.suffix == ".onnx":
        _unfold_batch_norms(network, _load_onnx(network, file), images)
    else:
        weights = torch.load(file, map_location="cpu")["averaged"]
        if "conv1.weight" in weights:
            weights["conv1.weight"] = _for_more_inputs(weights["conv1.weight"], network.conv1)
        network.load_state_dict(weights)


def _load_onnx(network: nn.Module, file: Path) -> dict[str, torch.Tensor]:
    """Copies the tensors of an exported network; returns the biases that folded batch norms left,
    by the convolution's name."""
    graph = onnx.load(str(file)).graph
    tensors = {t.name: numpy_helper.to_array(t) for t in graph.initializer}
    for node in graph.node:
        # Equal tensors are stored once.
        if node.op_type == "Identity" and node.input[0] in tensors:
            tensors[node.output[0]] = tensors[node.input[0]]
    parts = dict(network.named_modules())
    kept = {_part_of(n.name) for n in graph.node if n.op_type == "BatchNormalization"}
    offsets, missing = {}, {n for n, p in parts.items() if isinstance(p, _KINDS)}
    for node in graph.node:
        name = _part_of(node.name)
        if node.op_type not in ("Conv", "ConvTranspose", "BatchNormalization"):
            continue
        if name not in parts:
            raise ValueError(f"{file}: the network of this configuration has no part '{name}'")
        part, values = parts[name], [torch.tensor(tensors[i]) for i in node.input[1:]]
        fields = _BATCH_NORM if isinstance(part, nn.BatchNorm2d) else ("weight", "bias")
        for field, value in zip(fields, values):
            norm = _batch_norm_of(name)
            if field == "bias" and norm != name and norm in parts and norm not in kept:
                offsets[name] = value
                missing.discard(norm)
                if part.bias is not None:
                    part.bias.data.zero_()
                continue
            place = getattr(part, field)
            if name == "conv1" and field == "weight":
                value = _for_more_inputs(value, part)
            if place.shape != value.shape:
                raise ValueError(
                    f"{file}: {name}.{field} is {tuple(value.shape)}, "
                    f"in this configuration {tuple(place.shape)}"
                )
            place.data.copy_(value)
        missing.discard(name)
    if missing:
        raise ValueError(f"{file} has nothing for {', '.join(sorted(missing))}")
    return offsets


def _for_more_inputs(weight: torch.Tensor, convolution: nn.Conv2d) -> torch.Tensor:
    """The weights of a convolution that reads fewer channels; those of the others are 0."""
    more = convolution.in_channels - weight.shape[1]
    return nn.functional.pad(weight, (0, 0, 0, 0, 0, more)) if more > 0 else weight


def _part_of(node_name: str) -> str:
    """Name of the module of a node: /network/encoder.0/conv/Conv is encoder.0.conv; members of an
    nn.Sequential repeat its name, as in /network/head/head.1/Conv."""
    steps = []
    for step in node_name.split("/")[2:-1]:
        if steps and step.startswith(steps[-1] + "."):
            steps.pop()
        steps.append(step)
    return ".".join(steps)


_KINDS = (nn.Conv2d, nn.ConvTranspose2d, nn.BatchNorm2d)
_BATCH_NORM = ("weight", "bias", "running_mean", "running_var")


def _batch_norm_of(convolution: str) -> str:
    """conv1 is followed by bn1, encoder.0.conv by encoder.0.bn."""
    place, _, name = convolution.rpartition(".")
    return f"{place}.{name.replace('conv', 'bn')}" if place else name.replace("conv", "bn")


def _unfold_batch_norms(
    network: nn.Module, offsets: dict[str, torch.Tensor], images: Iterable[torch.Tensor]
) -> None:
    parts = dict(network.named_modules())
    statistics = {name: _Spread() for name in offsets}
    for name, offset in offsets.items():
        norm = parts[_batch_norm_of(name)]
        norm.reset_running_stats()
        norm.weight.data.fill_((1 + norm.eps) ** 0.5)
        norm.bias.data.copy_(offset)
    hooks = [
        parts[name].register_forward_hook(lambda _, __, y, s=spread: s.add(y))
        for name, spread in statistics.items()
    ]
    training = network.training
    network.eval()
    with torch.no_grad():
        for image in images:
            network(image)
    network.train(training)
    for hook in hooks:
        hook.remove()
    for name, spread in statistics.items():
        _normalise(parts[name], parts[_batch_norm_of(name)], spread)


class _Spread:
    """Mean and variance of each channel over all pixels of all images."""

    def __init__(self) -> None:
        self.count, self.sum, self.squares = 0, 0, 0

    def add(self, y: torch.Tensor) -> None:
        y = y.double()
        self.count += y.numel() // y.shape[1]
        self.sum += y.sum((0, 2, 3))
        self.squares += (y * y).sum((0, 2, 3))

    def mean(self) -> torch.Tensor:
        return (self.sum / self.count).float()

    def variance(self) -> torch.Tensor:
        return (self.squares / self.count - (self.sum / self.count) ** 2).clamp(min=0).float()


def _normalise(convolution: nn.Module, norm: nn.BatchNorm2d, spread: _Spread) -> None:
    lengths = convolution.weight.data.square().sum((1, 2, 3))
    scale = (SQUARED_LENGTH / lengths.clamp(min=1e-12)).sqrt()
    convolution.weight.data *= scale[:, None, None, None]
    norm.running_mean.copy_(scale * spread.mean())
    norm.running_var.copy_(scale**2 * spread.variance())
    norm.weight.data.copy_((norm.running_var + norm.eps).sqrt() / scale)
    norm.bias.data += spread.mean()
