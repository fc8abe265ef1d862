#!/usr/bin/env python3
"""Converts a model folder of lidar-bonnetal (RangeNet++) to one of Stillmap.

  import_rangenet.py darknet53-1024 config/models/darknet53_1024

The folder holds arch_cfg.yaml, data_cfg.yaml, backbone, segmentation_decoder and segmentation_head,
in PyTorch's old format or the new one. The same input then goes through PyTorch and Stillmap's
engines; exit code 1 if they do not agree, 2 if they cannot be compared. Weights that were trained on SemanticKITTI keep its
licence, CC BY-NC-SA: not for commercial use.
"""

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any, NoReturn

import torch
import yaml
from torch import nn

from model_folder import (
    Agreement,
    ProgramFault,
    check_engines,
    describe,
    find_program,
    random_images,
    write_model,
)
from networks import RangeNet
from scans import CLASS_NAMES, CLASS_OF_ID

MAX_DIFFERENCE = 1e-4
MIN_AGREEMENT = 0.9999


class ImportFault(Exception):
    """A model folder that cannot be imported; names the file and the fault."""


def read_yaml(file: Path) -> dict[str, Any]:
    try:
        content = yaml.safe_load(file.read_text())
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as fault:
        raise ImportFault(f"{file}: cannot be read: {fault}") from fault
    if not isinstance(content, dict):
        raise ImportFault(f"{file}: holds no fields")
    return content


def value_at(content: dict[str, Any], file: Path, *names: str) -> Any:
    """A nested field; the fault names its path."""
    for depth, name in enumerate(names, 1):
        if not isinstance(content, dict) or name not in content:
            raise ImportFault(f"{file}: has no field {'.'.join(map(str, names[:depth]))}")
        content = content[name]
    return content


def read_weights(file: Path) -> dict[str, torch.Tensor]:
    """A checkpoint's tensors. Only tensors are read: a file cannot run code."""
    try:
        state = torch.load(file, map_location="cpu", weights_only=True)
    except FileNotFoundError as fault:
        raise ImportFault(f"{file}: is missing") from fault
    # For a damaged file PyTorch raises many types of exceptions.
    except Exception as fault:  # noqa: BLE001
        raise ImportFault(f"{file}: is no checkpoint of PyTorch: {fault}") from fault
    if not isinstance(state, dict) or not all(torch.is_tensor(t) for t in state.values()):
        raise ImportFault(f"{file}: does not hold tensors by name")
    # Written from a network on several GPUs.
    return {name.removeprefix("module."): tensor for name, tensor in state.items()}


def load_part(part: nn.Module, file: Path) -> None:
    state = read_weights(file)
    for name, tensor in state.items():
        if tensor.is_floating_point() and not torch.isfinite(tensor).all():
            raise ImportFault(f"{file}: {name} holds numbers that are not finite")
    try:
        part.load_state_dict(state)
    except RuntimeError as fault:
        raise ImportFault(f"{file}: does not fit arch_cfg.yaml: {fault}") from fault


def read_classes(folder: Path) -> list[str]:
    """Stillmap's class of each output; `unlabeled` for labels outside the single-scan task."""
    file = folder / "data_cfg.yaml"
    original = value_at(read_yaml(file), file, "learning_map_inv")
    missing = [n for n in range(max(original, default=0) + 1) if n not in original]
    if missing:
        raise ImportFault(f"{file}: learning_map_inv has no entry {missing[0]}")
    return [CLASS_NAMES[CLASS_OF_ID.get(original[n], 0)] for n in range(len(original))]


def read_network(folder: Path) -> tuple[RangeNet, dict[str, Any], int]:
    file = folder / "arch_cfg.yaml"
    arch = read_yaml(file)
    for part in ("backbone", "decoder"):
        kind = value_at(arch, file, part, "name")
        if kind != "darknet":
            raise ImportFault(f"{file}: {part}.name is '{kind}'; only darknet can be imported")
    if arch.get("post", {}).get("CRF", {}).get("use"):
        raise ImportFault(f"{file}: post.CRF.use is true; networks with a CRF cannot be imported")
    inputs = value_at(arch, file, "backbone", "input_depth")
    if not all(inputs.get(channel) for channel in ("range", "xyz", "remission")):
        raise ImportFault(f"{file}: backbone.input_depth must take range, xyz and remission")
    layers = value_at(arch, file, "backbone", "extra", "layers")
    if layers not in (21, 53):
        raise ImportFault(f"{file}: backbone.extra.layers is {layers}; 21 and 53 can be imported")
    outputs = len(read_classes(folder))
    network = RangeNet(layers, outputs, value_at(arch, file, "backbone", "OS"))
    load_part(network.backbone, folder / "backbone")
    load_part(network.decoder, folder / "segmentation_decoder")
    load_part(network.head, folder / "segmentation_head")
    return network.eval(), arch, layers


def read_knn(arch: dict[str, Any]) -> dict[str, float]:
    """The post-processing that every published ++ figure has, with the folder's parameters."""
    written = arch.get("post", {}).get("KNN", {}).get("params", {})
    return {
        "neighbours": int(written.get("knn", 5)),
        "window": int(written.get("search", 5)),
        "sigma": float(written.get("sigma", 1.0)),
        "cutoff_m": float(written.get("cutoff", 1.0)),
    }


def describe_folder(
    folder: Path, arch: dict[str, Any], layers: int, arguments: argparse.Namespace
) -> dict[str, Any]:
    file = folder / "arch_cfg.yaml"
    sensor = value_at(arch, file, "dataset", "sensor")
    size = value_at(sensor, file, "img_prop")
    image = {
        "rows": int(size["height"]),
        "columns": int(size["width"]),
        "fov_up_deg": float(sensor["fov_up"]),
        "fov_down_deg": float(sensor["fov_down"]),
    }
    words = {
        "name": arguments.name or folder.name,
        "licence": arguments.licence,
        "sensor": str(sensor.get("name", "unknown")),
        "training": f"RangeNet{layers} of lidar-bonnetal, imported from {folder.name}",
        "accuracy": arguments.accuracy,
    }
    means, deviations = (
        value_at(arch, file, "dataset", "sensor", name) for name in ("img_means", "img_stds")
    )
    return describe(words, image, means, deviations, read_classes(folder), read_knn(arch))


def read_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("source", type=Path, help="lidar-bonnetal's model folder")
    parser.add_argument("folder", type=Path, help="the model folder to write")
    parser.add_argument("--name", help="default: the source's name")
    parser.add_argument("--licence", default="CC-BY-NC-SA-4.0 (trained on SemanticKITTI)")
    parser.add_argument("--accuracy", default="see the publication", help="in words")
    parser.add_argument("--stillmap", type=Path, default="build/release/bin/stillmap")
    parser.add_argument("--no-check", action="store_true", help="do not compare the engines")
    return parser.parse_args()


def agree(results: list[Agreement]) -> bool:
    """Tolerance for engines of the same precision."""
    return all(d <= MAX_DIFFERENCE and a >= MIN_AGREEMENT for _, _, d, a in results)


def compare_engines(
    arguments: argparse.Namespace, network: nn.Module, description: dict[str, Any]
) -> list[Agreement]:
    """What check_engines() gives for the engines of full precision."""
    images = random_images(1, (5, description["image"]["rows"], description["image"]["columns"]))
    engines = [("opencv", "fp32"), ("onednn", "fp32")]
    with tempfile.TemporaryDirectory() as scratch:
        return check_engines(
            arguments.stillmap, arguments.folder, network, images, Path(scratch), engines
        )


def end_without_comparison(fault: ProgramFault, what_is_there: str) -> NoReturn:
    print(
        f"import_rangenet: the engines cannot be compared with PyTorch: {fault}. {what_is_there}; "
        "--no-check leaves the comparison out",
        file=sys.stderr,
    )
    sys.exit(2)


def main() -> None:
    arguments = read_arguments()
    torch.set_num_threads(torch.multiprocessing.cpu_count())
    try:
        if not arguments.no_check:
            find_program(arguments.stillmap)
        network, arch, layers = read_network(arguments.source)
        description = describe_folder(arguments.source, arch, layers, arguments)
        write_model(arguments.folder, network, description)
    except ImportFault as fault:
        sys.exit(f"import_rangenet: {fault}")
    except ProgramFault as fault:
        end_without_comparison(fault, "Nothing was written")
    print(f"{arguments.folder}: model.onnx and model.yaml written")
    if arguments.no_check:
        return
    try:
        results = compare_engines(arguments, network, description)
    except ProgramFault as fault:
        end_without_comparison(fault, f"{arguments.folder} is there, unproven")
    if not agree(results):
        sys.exit("import_rangenet: the engines do not agree with PyTorch; do not use this model")


if __name__ == "__main__":
    main()
