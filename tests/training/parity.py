#!/usr/bin/env python3
"""How far Stillmap's engines agree with PyTorch on checkpoints of lidar-bonnetal's format.

  make parity
  parity.py --layers 21 --run runs/darknet21      trained weights instead of random ones

Every network and size goes through import_rangenet.py; exit code 1 if one does not agree.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from bonnetal_folder import arch_of, trained_looking, write_bonnetal
from export import load_run
from networks import RangeNet

SCRIPT = Path(os.environ["STILLMAP_TRAINING"]) / "import_rangenet.py"
IMAGES = [(64, 512), (64, 1024), (64, 2048), (32, 1024), (16, 1024)]


def network_of(layers, run):
    return load_run(run)[0] if run else trained_looking(RangeNet(layers))


def import_again(network, layers, image, new_format, scratch):
    """Writes the network as lidar-bonnetal does, imports it, returns how the engines agree."""
    rows, columns = image
    source = scratch / f"darknet{layers}_{rows}x{columns}"
    write_bonnetal(source, network, arch_of(layers, columns, rows), new_format)
    command = [sys.executable, SCRIPT, source, scratch / "model"]
    command += ["--stillmap", os.environ["STILLMAP"]]
    result = subprocess.run([*map(str, command)], capture_output=True, text=True)
    if result.returncode:
        print(result.stderr.strip())
    lines = [line for line in result.stdout.splitlines() if "largest difference" in line]
    return result.returncode == 0, lines


def read_arguments():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--layers", type=int, nargs="*", default=[21, 53], choices=[21, 53])
    parser.add_argument("--run", type=Path, help="folder of train.py with a network of --layers")
    return parser.parse_args()


def main():
    arguments = read_arguments()
    all_agree = True
    with tempfile.TemporaryDirectory() as scratch:
        for layers in arguments.layers:
            network = network_of(layers, arguments.run)
            for count, image in enumerate(IMAGES):
                new_format = count % 2 == 1
                agree, lines = import_again(network, layers, image, new_format, Path(scratch))
                all_agree = all_agree and agree
                kind = "zip" if new_format else "pickle"
                for line in lines:
                    print(f"DarkNet{layers} {image[0]:2}x{image[1]:<4} {kind:6} {line}", flush=True)
    return 0 if all_agree else 1


if __name__ == "__main__":
    sys.exit(main())
