"""Checkpoints in lidar-bonnetal's format become models with the same result on every engine."""

import os
import pickle
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import torch
import yaml

from bonnetal_folder import arch_of, random_bonnetal, trained_looking, write_bonnetal
from networks import RangeNet

STILLMAP = os.environ["STILLMAP"]
SCRIPT = Path(os.environ["STILLMAP_TRAINING"]) / "import_rangenet.py"


def run_import(source, folder, *options):
    command = [sys.executable, SCRIPT, source, folder, "--stillmap", STILLMAP, *options]
    return subprocess.run([*map(str, command)], capture_output=True, text=True)


class Folder(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.source = Path(scratch.name) / "darknet"
        self.model = Path(scratch.name) / "model"


class Import(Folder):
    def check(self, layers, new_format):
        random_bonnetal(self.source, layers, new_format)
        result = run_import(self.source, self.model)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("onednn   fp32", result.stdout)
        self.assertIn("opencv   fp32", result.stdout)
        written = yaml.safe_load((self.model / "model.yaml").read_text())
        self.assertEqual(written["classes"][9], "road")
        self.assertIn("NC", written["licence"])

    def test_takes_a_darknet21_of_the_old_format(self):
        self.check(21, new_format=False)

    def test_takes_a_darknet53_of_the_new_format(self):
        self.check(53, new_format=True)

    def test_takes_a_smaller_output_stride(self):
        network = trained_looking(RangeNet(21, output_stride=8))
        write_bonnetal(self.source, network, arch_of(21, 256, 16, output_stride=8))
        self.assertEqual(run_import(self.source, self.model).returncode, 0)


class Program(Folder):
    def refusal(self, program, folder=None):
        command = [sys.executable, SCRIPT, self.source, self.model, "--stillmap", program]
        result = subprocess.run([*map(str, command)], capture_output=True, text=True, cwd=folder)
        self.assertNotIn("Traceback", result.stderr)
        self.assertEqual(result.returncode, 2)
        self.assertIn("--no-check", result.stderr)
        return result.stderr

    def test_that_is_not_there_is_named_before_anything_is_written(self):
        self.assertIn("no such program", self.refusal("no/such/stillmap"))
        self.assertIn("no such program", self.refusal("no_such_stillmap"))
        self.assertFalse(self.model.exists())

    def test_that_is_no_program_or_fails_is_named(self):
        random_bonnetal(self.source, 21, new_format=True)
        text = self.source.parent / "stillmap"
        text.write_text("no program")
        self.assertIn("cannot be started", self.refusal(text))
        text.write_text("#!/bin/sh\nexit 3\n")
        text.chmod(0o755)
        # As a user says who stands beside it.
        self.assertIn("'stillmap model run' failed with 3", self.refusal("./stillmap", text.parent))
        self.assertTrue((self.model / "model.yaml").exists())


class Runs:
    """Pickles to a call: what a hostile checkpoint does."""

    def __reduce__(self):
        return (os.mkdir, ("it_ran",))


class HostileFolder(Folder):
    def setUp(self):
        super().setUp()
        random_bonnetal(self.source, 21)

    def refused(self, *words):
        result = run_import(self.source, self.model, "--no-check")
        self.assertNotEqual(result.returncode, 0)
        self.assertNotIn("Traceback", result.stderr)
        for word in words:
            self.assertIn(word, result.stderr)

    def change(self, name, change):
        file = self.source / name
        content = yaml.safe_load(file.read_text())
        change(content)
        file.write_text(yaml.safe_dump(content))

    def test_names_a_missing_file(self):
        (self.source / "segmentation_head").unlink()
        self.refused("segmentation_head", "missing")

    def test_names_a_truncated_file(self):
        file = self.source / "backbone"
        file.write_bytes(file.read_bytes()[:1000])
        self.refused("backbone")

    def test_names_weights_of_another_network(self):
        self.change("arch_cfg.yaml", lambda arch: arch["backbone"]["extra"].update(layers=53))
        self.refused("backbone", "arch_cfg.yaml")

    def test_names_another_architecture(self):
        self.change("arch_cfg.yaml", lambda arch: arch["backbone"].update(name="squeezeseg"))
        self.refused("backbone.name", "squeezeseg")

    def test_names_a_missing_field(self):
        self.change("arch_cfg.yaml", lambda arch: arch["dataset"].pop("sensor"))
        self.refused("arch_cfg.yaml", "dataset.sensor")

    def test_names_a_hole_in_the_class_map(self):
        self.change("data_cfg.yaml", lambda data: data["learning_map_inv"].pop(7))
        self.refused("data_cfg.yaml")

    def test_names_weights_that_are_not_finite(self):
        head = torch.load(self.source / "segmentation_head")
        head["1.bias"][3] = float("nan")
        torch.save(head, self.source / "segmentation_head")
        self.refused("segmentation_head", "1.bias")

    def test_runs_no_code(self):
        with open(self.source / "backbone", "wb") as file:
            pickle.dump({"conv1.weight": Runs()}, file)
        self.refused("backbone")
        self.assertFalse(Path("it_ran").exists())


if __name__ == "__main__":
    unittest.main()
