"""A small network learns from a simulated sequence, and an interrupted run resumes."""

import math
import os
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import torch
import yaml

from augmentation import aim, augment_points, crop, draw_motion, drop_beams, in_sector
from export import lidar_height, trained_for
from losses import class_weights, lovasz_softmax, weighted_cross_entropy
from range_images import ImageModel, RangeImage, normalise, project, slope_rad
from networks import make_network
from samples import TrainingSamples, _drawn_width
from scans import ScanFiles, image_rows, sensor_image
from train import Run, lidar_height_m
from validation import Confusion

STILLMAP = os.environ["STILLMAP"]
TRAINING = Path(os.environ["STILLMAP_TRAINING"])

STAGES = [[16, [1, 2], 1], [24, [2, 2], 1]]
SMALL = [
    "network.stem=8",
    f"network.stages={STAGES}",
    "optimiser.batch=2",
    "optimiser.averaged_steps=5",
    "augmentation.crop_columns=128",
    "augmentation.image_columns=[128,256]",
    "image.columns=256",
    "data.validation_scans=3",
]


class LovaszSoftmax(unittest.TestCase):
    def scores_of(self, classes):
        """Logits with probabilities 0 and 1 for these classes (rows x columns)."""
        return 1000.0 * torch.nn.functional.one_hot(classes, 20).permute(2, 0, 1)[None].float()

    def test_of_sure_predictions_is_one_less_the_mean_iou(self):
        truth = torch.randint(1, 6, (16, 64), generator=torch.manual_seed(1))
        found = torch.where(torch.rand(16, 64) < 0.6, truth, truth % 5 + 1)
        iou = [
            ((found == c) & (truth == c)).sum() / ((found == c) | (truth == c)).sum()
            for c in range(1, 6)
        ]
        loss = lovasz_softmax(self.scores_of(found), truth[None])
        self.assertAlmostEqual(float(loss), 1 - float(torch.stack(iou).mean()), places=5)

    def test_leaves_out_pixels_without_a_class(self):
        truth = torch.tensor([[1, 0, 2, 0]])
        loss = lovasz_softmax(self.scores_of(torch.tensor([[1, 5, 2, 1]])), truth[None])
        self.assertAlmostEqual(float(loss), 0.0, places=5)

    def test_have_no_gradient_without_any_class(self):
        scores = torch.randn(1, 20, 2, 4, requires_grad=True)
        nothing = torch.zeros(1, 2, 4, dtype=torch.long)
        lovasz_softmax(scores, nothing).backward()
        weighted_cross_entropy(scores, nothing, torch.ones(20)).backward()
        self.assertEqual(scores.grad.abs().max(), 0)


class Projection(unittest.TestCase):
    model = ImageModel(rows=4, columns=8, fov_up_deg=10, fov_down_deg=-30)

    def test_puts_forward_in_the_middle_and_left_into_the_left_half(self):
        points = np.array([[5, -0.01, 0], [0, 5, 0], [0, -5, 0]], np.float32)
        image = project(points, np.zeros(3, np.float32), self.model)
        self.assertEqual([p % 8 for p in image.pixel], [4, 2, 6])

    def test_keeps_the_nearest_point_of_a_pixel(self):
        points = np.array([[9, 0, 0], [4, 0, 0], [7, 0, 0]], np.float32)
        image = project(points, np.zeros(3, np.float32), self.model)
        self.assertEqual(image.point[image.point >= 0].tolist(), [1])

    def test_clamps_points_above_the_image_to_the_first_row(self):
        image = project(np.array([[1, 0, 5]], np.float32), np.zeros(1, np.float32), self.model)
        self.assertLess(image.pixel[0], 8)

    def test_leaves_empty_pixels_zero(self):
        image = project(np.array([[5, 0, 0]], np.float32), np.ones(1, np.float32), self.model)
        channels = normalise(image, [1, 2, 3, 4, 5], [2, 2, 2, 2, 2])
        self.assertEqual(np.count_nonzero(channels[0]), 1)
        self.assertEqual(channels[0].max(), 2)


class Slope(unittest.TestCase):
    model = ImageModel(rows=8, columns=8, fov_up_deg=10, fov_down_deg=-30)

    def slopes(self, points):
        image = project(points, np.zeros(len(points), np.float32), self.model)
        seen = image.point >= 0
        return slope_rad(image.channels, seen), seen

    def test_is_zero_on_level_ground_and_a_right_angle_on_a_wall(self):
        up = np.radians(np.arange(-27.5, -5, 5))
        ground = np.stack([-1.8 / np.tan(up), 0.1 + 0 * up, np.full(up.size, -1.8)], 1)
        wall = np.stack([np.full(up.size, -6.0), 0.1 + 0 * up, 6 * np.tan(up)], 1)
        slope, seen = self.slopes(np.concatenate([ground, wall]).astype(np.float32))
        self.assertEqual(seen.sum(), 10)
        np.testing.assert_allclose(slope[:, :2].max(), np.pi / 2, atol=1e-4)
        np.testing.assert_allclose(slope[seen], np.where(np.nonzero(seen)[1] < 2, np.pi / 2, 0), atol=1e-4)

    def test_looks_across_two_empty_rows_but_no_further(self):
        up = np.radians([7.5, -7.5, -27.5])
        slope, seen = self.slopes(np.stack([6 + 0 * up, 0 * up - 0.1, 6 * np.tan(up)], 1).astype(np.float32))
        self.assertEqual((np.abs(slope[seen]) > 0.1).tolist(), [True, True, False])
        self.assertEqual(slope[~seen].tolist(), [0] * 61)

    def test_is_the_sixth_channel_where_the_network_takes_it(self):
        points = np.array([[5, 0, 0], [5, 0, 0.5]], np.float32)
        image = project(points, np.ones(2, np.float32), self.model)
        plain = normalise(image, [1, 2, 3, 4, 5], [2, 2, 2, 2, 2])
        channels = normalise(image, [1, 2, 3, 4, 5, 0.5], [2, 2, 2, 2, 2, 0.5])
        np.testing.assert_array_equal(channels[:5], plain)
        seen = image.point >= 0
        np.testing.assert_allclose(channels[5][seen], (np.pi / 2 - 0.5) / 0.5, rtol=1e-5)
        self.assertEqual(np.abs(channels[5][~seen]).max(), 0)


class Loss(unittest.TestCase):
    def test_weighs_rare_classes_more(self):
        shares = [0.1, 0.7, 0.2]
        for kind in ("log", "inverse"):
            weights = class_weights(shares, kind)
            self.assertEqual(weights[0], 0)
            self.assertGreater(weights[2], weights[1])
        self.assertAlmostEqual(class_weights(shares, "inverse")[1].item(), 1 / 0.701, places=5)
        self.assertAlmostEqual(class_weights(shares, "log")[1].item(), 1 / math.log(1.72), places=5)

    def test_leaves_pixels_without_a_class_out(self):
        weights = torch.tensor([0.0, 2.0, 1.0])
        scores = torch.randn(1, 3, 1, 4)
        target = torch.tensor([[[1, 2, 0, 0]]])
        loss = weighted_cross_entropy(scores, target, weights)
        logs = torch.log_softmax(scores, 1)[0, :, 0]
        expected = -(2 * logs[1, 0] + logs[2, 1]) / 3
        torch.testing.assert_close(loss, expected)


class Metric(unittest.TestCase):
    def test_counts_as_the_benchmark_does(self):
        confusion = Confusion(3)
        confusion.add(np.array([1, 1, 2, 2, 0]), np.array([1, 2, 2, 0, 1]))
        self.assertEqual(confusion.iou()[1:].tolist(), [1 / 2, 1 / 3])


class Augmentation(unittest.TestCase):
    settings = {
        "rotate": True, "flip": True, "tilt_deg": 0, "scale": 0, "lift_m": 0,
        "range_noise_m": 0, "drop_points": 0, "max_range_m": 120, "drop_beams": 0,
        "halve_beams": 1, "remission_jitter": 0.3, "remission_dropout": 0, "aim_at_classes": 0,
    }  # fmt: skip

    def test_turning_and_mirroring_keep_ranges_and_heights(self):
        random = np.random.default_rng(1)
        points = random.normal(0, 10, (50, 3)).astype(np.float32)
        motion = draw_motion(self.settings, random)
        moved, remission, classes = augment_points(
            points, np.full(50, 0.5, np.float32), np.arange(50), motion, self.settings, random
        )
        ranges = np.linalg.norm(points, axis=1)
        np.testing.assert_allclose(np.linalg.norm(moved, axis=1), ranges, rtol=1e-5)
        np.testing.assert_allclose(moved[:, 2], points[:, 2], rtol=1e-5)
        self.assertFalse(np.allclose(moved, points))
        self.assertEqual(classes.tolist(), list(range(50)))
        self.assertTrue(((remission >= 0) & (remission <= 1)).all())

    def test_loses_every_other_beam(self):
        random = np.random.default_rng(2)
        points = random.normal(0, 10, (5000, 3)).astype(np.float32)
        image = project(points, np.zeros(5000, np.float32), ImageModel(8, 16, 20, -20))
        drop_beams(image, 8, self.settings, random)
        self.assertEqual(sum((row >= 0).any() for row in image.point), 4)

    def test_crops_over_the_seam_together(self):
        channels = np.tile(np.arange(8.0), (5, 2, 1))
        for azimuth in np.linspace(-np.pi, np.pi, 20):
            part, target = crop(channels, channels[0], 6, azimuth)
            self.assertEqual(part.shape, (5, 2, 6))
            np.testing.assert_array_equal(part[0], target)
            off = part[0, 0, 3] - 4 * (1 - azimuth / np.pi)
            self.assertLess(abs((off + 4) % 8 - 4), 0.51)


class Aim(unittest.TestCase):
    def scan(self):
        """A wall all round, and one point of something rare."""
        azimuth = np.linspace(-np.pi, np.pi, 721)
        points = np.stack([10 * np.cos(azimuth), 10 * np.sin(azimuth), 0 * azimuth], 1)
        classes = np.full(721, 13, np.uint8)
        classes[500] = 6
        return points.astype(np.float32), classes

    def test_takes_rare_classes_as_often_as_others(self):
        points, classes = self.scan()
        width, random = np.radians(30), np.random.default_rng(1)
        held = {0.0: 0, 1.0: 0}
        for share in held:
            for _ in range(200):
                middle = aim(points, classes, width, share, random)
                held[share] += in_sector(points, middle, width)[500]
        self.assertLess(held[0.0], 40)
        self.assertGreater(held[1.0], 85)

    def test_a_sector_is_as_wide_as_asked_for(self):
        points, _ = self.scan()
        for middle in (-3.1, 0.0, 2.0):
            self.assertAlmostEqual(in_sector(points, middle, np.pi / 2).sum(), 181, delta=2)
            self.assertTrue(in_sector(points, middle, 7.0).all())

    def test_finds_somewhere_in_a_scan_without_classes(self):
        points, classes = self.scan()
        azimuth = aim(points, 0 * classes, 1.0, 1.0, np.random.default_rng(1))
        self.assertTrue(np.isfinite(azimuth))


class FewScans:
    """One scan of a wall all round in four rows, of a sensor whose beams fill any width."""

    images = [ImageModel(4, 64, 10, -10, 64)]

    def read(self, index):
        azimuth = np.linspace(-np.pi, np.pi, 2000)
        points = [10 * np.cos(azimuth), 10 * np.sin(azimuth), np.tile([-1, 0, 0.5, 1], 500)]
        points = np.stack(points, 1).astype(np.float32)
        return points, np.full(2000, 0.5, np.float32), np.full(2000, 13)


class Widths(unittest.TestCase):
    def config(self, widths):
        settings = {**Augmentation.settings, "crop_columns": 32, "image_columns": widths}
        settings["halve_beams"] = 0
        return {"mean": [0] * 5, "deviation": [1] * 5, "augmentation": settings}

    def filled_columns(self, widths):
        """Of crops of scans that are drawn `widths` wide: how many columns have a point."""
        samples = TrainingSamples(FewScans(), self.config(widths))
        targets = [samples[0, seed][1] for seed in range(8)]
        self.assertEqual({target.shape for target in targets}, {(4, 32)})
        return {int((target > 0).any(0).sum()) for target in targets}

    def test_are_drawn_for_each_scan(self):
        self.assertEqual(self.filled_columns([]), {32})
        # So wide that most columns get no point.
        self.assertLess(max(self.filled_columns([16384])), 20)
        self.assertGreater(len(self.filled_columns([64, 16384])), 1)

    def test_a_part_without_points_is_empty(self):
        samples = TrainingSamples(FewScans(), self.config([]))
        far = np.full((1, 3), 500, np.float32)
        samples.scans.read = lambda _: (far, np.ones(1), np.ones(1, int))
        channels, target = samples[0, 1]
        self.assertEqual((channels.abs().max(), target.max()), (0, 0))


class Sensors(unittest.TestCase):
    def setUp(self):
        self.random = np.random.default_rng(1)

    def test_are_told_as_all_that_the_scans_were_of(self):
        scans = ScanFiles.__new__(ScanFiles)
        scans.images = [ImageModel(64, 2048, 3, -25), ImageModel(16, 2048, np.float32(15), -15)]
        self.assertEqual(
            yaml.safe_load(yaml.safe_dump(scans.trained_for())),
            {"min_beams": 16, "max_beams": 64, "fov_up_deg": 15, "fov_down_deg": -25},
        )

    def test_of_a_run_of_an_older_trainer_are_not_guessed(self):
        self.assertEqual(trained_for({"config": {}}), {})
        self.assertEqual(lidar_height({"config": {}}), {})

    def test_have_the_rows_that_the_engine_gives_them(self):
        # The same table as in model_description_test.cpp.
        even = {16: 32, 20: 40, 32: 48, 40: 56, 64: 64, 128: 96, 1024: 128, 1: 8}
        for rings, rows in even.items():
            sensor = {"rings": rings, "fov_up_deg": 15, "fov_down_deg": -15}
            self.assertEqual(image_rows(sensor, 64), rows, rings)
        uneven = {"rings": 32, "fov_up_deg": 15, "fov_down_deg": -25}
        steps = np.arange(32) - 12.0
        beyond = np.copysign(np.maximum(0, np.abs(steps) - 9), steps)
        uneven["beam_elevations_deg"] = [float(e) for e in -0.333 * steps - beyond]
        self.assertEqual(image_rows(uneven, 64), 64)
        bands = {"pattern": "irregular", "rings": 40, "fov_up_deg": 52, "fov_down_deg": -7}
        self.assertEqual(image_rows(bands, 64), 40)

    def test_of_few_beams_have_twice_the_rows_and_fewer_columns_and_keep_their_beams(self):
        with tempfile.TemporaryDirectory() as folder:
            text = "{name: VLP-16, rings: 16, fov_up_deg: 16, fov_down_deg: -16}"
            (Path(folder) / "sensor.yaml").write_text(text)
            image = sensor_image(Path(folder), ImageModel(64, 2048, 3, -25))
        self.assertEqual(image, ImageModel(32, 1536, 16, -16, 16))
        self.assertEqual(_drawn_width(image, {"image_columns": [2048]}, self.random).columns, 1536)
        scans = ScanFiles.__new__(ScanFiles)
        scans.images = [image]
        self.assertEqual(scans.trained_for()["max_beams"], 16)

    def test_that_lose_every_other_beam_keep_both_rows_of_the_others(self):
        image = RangeImage(np.ones((5, 32, 4)), np.zeros((32, 4), int), np.zeros(0, int))
        drop_beams(image, 16, {"drop_beams": 0, "halve_beams": 1}, self.random)
        kept = (image.point[:, 0] == 0).reshape(16, 2)
        self.assertEqual(kept.sum(), 16)
        np.testing.assert_array_equal(kept[:, 0], kept[:, 1])

    def test_heights_are_those_of_the_configuration_or_of_the_model_before(self):
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / "model.yaml").write_text("lidar_height_m: 1.73\n")
            self.assertEqual(lidar_height_m({"start_from": folder}), 1.73)
            self.assertEqual(lidar_height_m({"start_from": folder, "lidar_height_m": 0.6}), 0.6)
        self.assertIsNone(lidar_height_m({"start_from": ""}))
        self.assertEqual(lidar_height({"lidar_height_m": 0.6}), {"lidar_height_m": 0.6})


class Numbers(unittest.TestCase):
    def test_are_of_16_bits_where_asked_for(self):
        torch.manual_seed(1)
        network = make_network({"kind": "light", "stem": 8, "stages": STAGES}, 20)
        image = torch.randn(1, 5, 16, 64)

        def scores(settings):
            config = {"optimiser": settings}
            run = SimpleNamespace(config=config, device="cpu", network=network.eval())
            return Run.scores(run, image)

        exact, reduced = scores({}), scores({"bfloat16": True})
        self.assertEqual(reduced.dtype, torch.float32)
        difference = (reduced - exact).abs().max() / exact.abs().max()
        self.assertGreater(difference, 1e-5)
        self.assertLess(difference, 0.1)


class Training(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(scratch.cleanup)
        cls.root = Path(scratch.name)
        cls.data = cls.root / "data"
        sequence = cls.data / "sequences" / "00"
        command = [STILLMAP, "simulate", sequence, "--preset", "yard", "--scans", "8"]
        subprocess.run([*map(str, command), "--sensor", "vlp_16"], check=True, capture_output=True)

    def train(self, epochs, run="run", *more):
        settings = [*SMALL, f"optimiser.epochs={epochs}", f"data.train=[{self.data}]"]
        settings += [f"data.validation=[{self.data}]", *more]
        command = [sys.executable, TRAINING / "train.py", TRAINING / "training.yaml"]
        command += [self.root / run]
        for setting in settings:
            command += ["--set", setting]
        result = subprocess.run([*map(str, command)], capture_output=True, text=True)
        self.assertEqual(result.returncode, 0, result.stderr)
        return result.stdout

    def test_refuses_scans_of_another_lidar_than_the_configurations(self):
        copy = self.root / "copy"
        shutil.copytree(self.data, copy)
        (copy / "sequences" / "00" / "sensor.yaml").unlink()
        scans = ScanFiles([copy], [], ImageModel(64, 256, 3, -25))
        with self.assertRaisesRegex(ValueError, "no sensor.yaml.* 3[0-9]% of the points"):
            scans.require_field_of_view()
        ScanFiles([copy], [], ImageModel(16, 256, 15.5, -15.5)).require_field_of_view()
        ScanFiles([self.data], [], ImageModel(64, 256, 3, -25)).require_field_of_view()
        command = [sys.executable, TRAINING / "train.py", TRAINING / "training.yaml"]
        command += [self.root / "refused", "--set", f"data.train=[{copy}]"]
        command += ["--set", f"data.validation=[{copy}]"]
        result = subprocess.run([*map(str, command)], capture_output=True, text=True)
        self.assertEqual(result.returncode, 1)
        self.assertIn("stillmap dataset sensor", result.stderr)
        self.assertNotIn("Traceback", result.stderr)

    def test_learns_resumes_and_exports(self):
        self.train(2)
        output = self.train(6)
        self.assertIn("goes on after epoch 2", output)
        history = torch.load(self.root / "run" / "last.pt")["history"]
        self.assertEqual([entry["epoch"] for entry in history], [1, 2, 3, 4, 5, 6])
        self.assertLess(history[1]["loss"], history[0]["loss"])
        # It resumes with the longer run's schedule: in that of the first, the rate would be 0.
        self.assertLess(history[-1]["loss"], 0.95 * history[1]["loss"])
        rate = torch.load(self.root / "run" / "last.pt")["schedule"]["lr_lambdas"][0]
        self.assertEqual(rate["settings"]["epochs"], 6)
        for picture in ("curves.png", "labels_0.png"):
            self.assertGreater((self.root / "run" / picture).stat().st_size, 1000)
        sequence = self.data / "sequences" / "00"
        command = [sys.executable, TRAINING / "export.py", self.root / "run", self.root / "model"]
        command += ["--last", "--stillmap", STILLMAP, "--calibrate", sequence]
        result = subprocess.run([*map(str, command)], capture_output=True, text=True)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("onednn   int8", result.stdout)
        self.assertTrue((self.root / "model" / "int8.yaml").exists())
        description = yaml.safe_load((self.root / "model" / "model.yaml").read_text())
        # As sensor.yaml of the sequence says, not as the configuration.
        self.assertEqual(
            description["trained_for"],
            {"min_beams": 16, "max_beams": 16, "fov_up_deg": 16, "fov_down_deg": -16},
        )
        self.assertEqual(description["voxel_votes"]["use"], True)
        self.assertEqual(description["voxel_votes"]["height_m"], 0.1)
        self.assertEqual(description["unsure_votes"]["unsure_below"], 0.35)
        self.assertEqual(description["island_votes"], {"use": True, "edge_m": 0.3, "share": 0.7})
        image = description["image"]
        self.assertEqual((image["columns"], image["min_columns"]), (256, 128))
        # A run from that model begins where this one ended.
        self.train(1, "next", f"start_from={self.root / 'model'}")
        first = torch.load(self.root / "next" / "last.pt")["history"][0]
        self.assertLess(first["loss"], 0.95 * history[1]["loss"])


if __name__ == "__main__":
    unittest.main()
