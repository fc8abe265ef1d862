"""Writes model folders in lidar-bonnetal's format, for tests of the import."""

from pathlib import Path

import torch
import yaml

from networks import RangeNet
from scans import CLASS_NAMES, CLASS_OF_ID

ARCH = {
    "train": {"loss": "xentropy", "max_epochs": 150, "batch_size": 8},
    "backbone": {
        "name": "darknet",
        "input_depth": {"range": True, "xyz": True, "remission": True},
        "dropout": 0.01,
        "bn_d": 0.01,
        "OS": 32,
        "train": True,
    },
    "decoder": {"name": "darknet", "dropout": 0.01, "bn_d": 0.01, "extra": False, "train": True},
    "head": {"name": "segmentation", "train": True, "dropout": 0.01},
    "post": {
        "CRF": {"use": False, "train": True, "params": False},
        "KNN": {"use": False, "params": {"knn": 5, "search": 5, "sigma": 1.0, "cutoff": 1.0}},
    },
    "dataset": {
        "labels": "kitti",
        "scans": "kitti",
        "max_points": 150000,
        "sensor": {
            "name": "HDL64",
            "type": "spherical",
            "fov_up": 3,
            "fov_down": -25,
            "img_prop": {"width": 1024, "height": 64},
            "img_means": [12.12, 10.88, 0.23, -1.04, 0.21],
            "img_stds": [12.32, 11.47, 6.91, 0.86, 0.16],
        },
    },
}


def arch_of(layers, columns=1024, rows=64, output_stride=32):
    sensor = {**ARCH["dataset"]["sensor"], "img_prop": {"width": columns, "height": rows}}
    backbone = {**ARCH["backbone"], "extra": {"layers": layers}, "OS": output_stride}
    return {**ARCH, "backbone": backbone, "dataset": {**ARCH["dataset"], "sensor": sensor}}


def data_cfg():
    original = {0: 0}
    for label, number in CLASS_OF_ID.items():
        original.setdefault(number, label)
    return {
        "name": "kitti",
        "labels": {original[n]: name for n, name in enumerate(CLASS_NAMES)},
        "learning_map": {0: 0, **CLASS_OF_ID},
        "learning_map_inv": dict(sorted(original.items())),
    }


def trained_looking(network, seed=0):
    """Gives the batch norms the statistics of random images, as training would."""
    torch.manual_seed(seed)
    for module in network.modules():
        if isinstance(module, torch.nn.BatchNorm2d):
            torch.nn.init.uniform_(module.weight, 0.5, 1.5)
            torch.nn.init.normal_(module.bias, 0, 0.1)
            module.momentum = None
    network.train()
    with torch.no_grad():
        network(torch.randn(2, 5, 16, 64))
    return network.eval()


def write_bonnetal(folder, network, arch, new_format=False):
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "arch_cfg.yaml").write_text(yaml.safe_dump(arch))
    (folder / "data_cfg.yaml").write_text(yaml.safe_dump(data_cfg()))
    parts = {
        "backbone": network.backbone,
        "segmentation_decoder": network.decoder,
        "segmentation_head": network.head,
    }
    for name, part in parts.items():
        file = folder / name
        torch.save(part.state_dict(), file, _use_new_zipfile_serialization=new_format)


def random_bonnetal(folder, layers, new_format=False, columns=256, rows=16):
    network = trained_looking(RangeNet(layers))
    write_bonnetal(folder, network, arch_of(layers, columns, rows), new_format)
    return network
