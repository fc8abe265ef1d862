"""Model folders: model.onnx and the model.yaml that describes it, as config/loaders reads them."""

import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
import yaml
from torch import nn

from networks import WithSoftmax
from scans import CLASS_NAMES

# Engine, precision, largest difference of probabilities, share of pixels of the same class.
Agreement = tuple[str, str, float, float]

CHANNELS = ("range", "x", "y", "z", "remission", "slope")


def export_onnx(
    network: nn.Module, file: Path, shape: tuple[int, int, int], free_size: bool
) -> None:
    """Writes the network with a soft-max. `shape`: channels, rows, columns; `free_size` leaves the
    last two open."""
    axes = {2: "rows", 3: "columns"}
    torch.onnx.export(
        WithSoftmax(network).cpu().eval(),
        torch.zeros(1, *shape),
        str(file),
        opset_version=13,
        input_names=["range_image"],
        output_names=["probabilities"],
        dynamic_axes={"range_image": axes, "probabilities": axes} if free_size else None,
    )


def describe(
    words: dict[str, Any],
    image: dict[str, Any],
    mean: Sequence[float],
    deviation: Sequence[float],
    classes: list[str],
    knn: dict[str, Any] | None,
    follow_sensor: bool = False,
    voxel_votes: dict[str, Any] | None = None,
    unsure_votes: dict[str, Any] | None = None,
    island_votes: dict[str, Any] | None = None,
) -> dict[str, Any]:
    """The content of model.yaml. `words`: name, licence, sensor, trained_for, lidar_height_m,
    training, accuracy; `classes`: name of the class of each output; `knn`: None, or neighbours, window, sigma,
    cutoff_m; `voxel_votes`: None, or edge_m, height_m, neighbour_weight, own_weight; `unsure_votes`:
    None (the usual ones after votes in voxels), or edge_m, height_m, neighbour_weight, unsure_below,
    unsure_small_below, small_weight; `island_votes`: None, or edge_m, share."""
    description = {
        **words,
        "image": {**image, "follow_sensor": follow_sensor},
        "statistics": {
            name: {"mean": float(m), "deviation": float(d)}
            for name, m, d in zip(CHANNELS, mean, deviation)
        },
        "classes": dict(enumerate(classes)),
        "knn": {"use": knn is not None, **(knn or {})},
        "voxel_votes": {"use": voxel_votes is not None, **(voxel_votes or {})},
    }
    if unsure_votes is not None:
        description["unsure_votes"] = {"use": True, **unsure_votes}
    if island_votes is not None:
        description["island_votes"] = {"use": True, **island_votes}
    return description


def write_model(folder: str | Path, network: nn.Module, description: dict[str, Any]) -> None:
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    image = description["image"]
    shape = len(description["statistics"]), image["rows"], image["columns"]
    export_onnx(network, folder / "model.onnx", shape, image["follow_sensor"])
    # Of the weights that were there before.
    (folder / "int8.yaml").unlink(missing_ok=True)
    text = yaml.safe_dump(description, sort_keys=False, width=100, allow_unicode=True)
    (folder / "model.yaml").write_text(text)


class ProgramFault(Exception):
    """The program `stillmap` cannot be started, or failed."""


def find_program(name: str | Path) -> Path:
    """Where the program is: a path, also one without a folder (as `./stillmap` becomes), else a name
    in PATH."""
    path = Path(name)
    if path.is_file():
        return path.resolve()
    found = shutil.which(str(name)) if path.parent == Path() else None
    if not found:
        raise ProgramFault(f"{name}: no such program; --stillmap names it")
    return Path(found)


def run_stillmap(stillmap: str | Path, *arguments: object) -> None:
    """Runs it; what it prints is seen. Raises ProgramFault where that fails."""
    command = [str(find_program(stillmap)), *map(str, arguments)]
    try:
        subprocess.run(command, check=True)
    except OSError as fault:
        raise ProgramFault(f"{command[0]} cannot be started: {fault.strerror}") from fault
    except subprocess.CalledProcessError as fault:
        words = " ".join(command[1:3])
        raise ProgramFault(f"'stillmap {words}' failed with {fault.returncode}") from fault


def run_engine(
    stillmap: str | Path,
    folder: Path,
    images: np.ndarray,
    engine: str,
    precision: str,
    scratch: Path,
) -> np.ndarray:
    """Probabilities (n x classes x rows x columns) of `images` by one of Stillmap's engines."""
    inputs, outputs = scratch / "input.f32", scratch / f"{engine}_{precision}.f32"
    images.astype("<f4").tofile(inputs)
    choice = ["--engine", engine, "--precision", precision]
    run_stillmap(stillmap, "model", "run", folder, *choice, "--input", inputs, "--output", outputs)
    n, _, rows, columns = images.shape
    return np.fromfile(outputs, "<f4").reshape(n, -1, rows, columns)


def compare(reference: np.ndarray, other: np.ndarray) -> tuple[float, float]:
    """Largest difference, and the share of pixels with the same most probable class."""
    same = reference.argmax(1) == other.argmax(1)
    return float(np.abs(reference - other).max()), float(same.mean())


def check_engines(
    stillmap: str | Path,
    folder: Path,
    network: nn.Module,
    images: np.ndarray,
    scratch: Path,
    engines: list[tuple[str, str]],
) -> list[Agreement]:
    """Runs the same images through PyTorch and `engines` [(engine, precision)]; prints how they
    agree, and returns [(engine, precision, largest difference, agreement)]."""
    with torch.no_grad():
        network = WithSoftmax(network).eval()
        reference = np.concatenate([network(torch.from_numpy(i[None])).numpy() for i in images])
    results = []
    for engine, precision in engines:
        found = run_engine(stillmap, folder, images, engine, precision, scratch)
        difference, agreement = compare(reference, found)
        results.append((engine, precision, difference, agreement))
        print(
            f"{engine:8} {precision:5} largest difference of probabilities {difference:.2e}, "
            f"same class in {100 * agreement:.3f} % of {reference[:, 0].size} pixels"
        )
    return results


def random_images(count: int, shape: tuple[int, int, int], seed: int = 1) -> np.ndarray:
    """Images with empty pixels, of about the spread of normalised scans. `shape`: channels, rows,
    columns."""
    random = np.random.default_rng(seed)
    images = random.normal(0, 1, (count, *shape)).astype(np.float32)
    images *= random.random((count, 1, *shape[1:])) > 0.2
    return images


def class_names(count: int = len(CLASS_NAMES)) -> list[str]:
    return CLASS_NAMES[:count]
