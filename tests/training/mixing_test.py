"""Parts and objects of scans in other scans, and how often each scan is drawn."""

import tempfile
import unittest
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from leave_out import fold_config, sequences_of
from mixing import Objects, height_of_ground, mix_bands, mix_sectors, turned
from range_images import ImageModel, elevation_rad
from samples import BatchesBySensor
from scans import CLASS_NAMES

CAR, ROAD, BUILDING = (CLASS_NAMES.index(name) for name in ("car", "road", "building"))


def sphere(count, label, seed=1):
    """Points all round, 10 m away, of one class."""
    points = np.random.default_rng(seed).normal(0, 1, (count, 3)).astype(np.float32)
    points *= 10 / np.linalg.norm(points, axis=1)[:, None]
    return points, np.full(count, 0.5, np.float32), np.full(count, label, np.uint8)


class Mixing(unittest.TestCase):
    def test_sectors_share_the_border_and_nothing_else(self):
        one, other = sphere(3000, ROAD), sphere(3000, CAR, 2)
        points, _, classes = mix_sectors(one, other, 0.5, 1.0, np.random.default_rng(3))
        azimuth = np.arctan2(points[:, 1], points[:, 0])
        near = np.abs(azimuth - 0.5) < 0.5
        right, left = azimuth[near & (classes == CAR)], azimuth[near & (classes == ROAD)]
        self.assertGreater(len(right), 20)
        self.assertGreater(len(left), 20)
        self.assertLess(right.max(), left.min() + 1e-6)

    def test_bands_of_elevation_come_from_one_scan_each(self):
        model = ImageModel(64, 512, 10, -30)
        one, other = sphere(6000, ROAD), sphere(6000, CAR, 2)
        for seed in range(10):
            points, _, classes = mix_bands(one, other, model, np.random.default_rng(seed))
            self.assertEqual(set(classes), {ROAD, CAR})
            ordered = classes[np.argsort(elevation_rad(points))]
            self.assertLessEqual(np.count_nonzero(np.diff(ordered.astype(int))), 4)

    def test_turning_keeps_heights_and_ranges(self):
        points, _, _ = sphere(100, ROAD)
        moved = turned(points, 0.3)
        np.testing.assert_allclose(moved[:, 2], points[:, 2], atol=1e-5)
        change = np.arctan2(moved[:, 1], moved[:, 0]) - np.arctan2(points[:, 1], points[:, 0])
        np.testing.assert_allclose(np.mod(change, 2 * np.pi), 0.3, atol=1e-4)


def street(ground_m, with_car=True):
    """A road at this height, and perhaps a car upon it, 8 m ahead; its instance is 7."""
    x, y = np.meshgrid(np.linspace(-20, 20, 60), np.linspace(-20, 20, 60))
    road = np.stack([x.ravel(), y.ravel(), np.full(x.size, ground_m)], 1)
    car = np.random.default_rng(1).uniform([7, -1, 0], [9, 1, 1.5], (200, 3)) + [0, 0, ground_m]
    parts = [(road, ROAD, 0), *([(car, CAR, 7)] if with_car else [])]
    points = np.concatenate([p for p, _, _ in parts]).astype(np.float32)
    classes = np.concatenate([np.full(len(p), c, np.uint8) for p, c, _ in parts])
    instances = np.concatenate([np.full(len(p), i, np.uint32) for p, _, i in parts])
    return points, np.full(len(points), 0.3, np.float32), classes, instances


class SettingObjects(unittest.TestCase):
    def setUp(self):
        scans = SimpleNamespace(
            evenly_chosen=lambda most: [0], read_instances=lambda index: street(-1.7)
        )
        self.objects = Objects(scans)

    def test_stand_on_the_ground_at_their_range(self):
        self.assertEqual({key: len(found) for key, found in self.objects.of_class.items()}, {CAR: 1})
        empty = street(-1.2, with_car=False)[:3]
        for seed in range(10):
            points, remission, classes = self.objects.set_into(
                empty, 2.0, 0.6, np.random.default_rng(seed)
            )
            car = points[classes == CAR]
            self.assertEqual(len(points), len(remission))
            self.assertEqual(len(car), 200)
            self.assertAlmostEqual(car[:, 2].min(), -1.2, delta=0.05)
            x, y, _ = np.median(car, axis=0)
            self.assertAlmostEqual(np.hypot(x, y), 8, delta=0.3)
            self.assertAlmostEqual(np.arctan2(y, x), 2.0, delta=0.31)

    def test_stay_out_where_no_ground_is(self):
        houses = sphere(500, BUILDING)
        points, _, _ = self.objects.set_into(houses, 0.0, 0.6, np.random.default_rng(1))
        self.assertEqual(len(points), 500)

    def test_ground_is_the_median_of_enough_points(self):
        points, _, classes, _ = street(-1.7)
        self.assertAlmostEqual(height_of_ground(points, classes, 8, 0), -1.7, places=5)
        self.assertIsNone(height_of_ground(points, classes, 100, 0))


class Draws(unittest.TestCase):
    def test_take_each_folder_as_often_as_asked_for(self):
        image = SimpleNamespace(rows=64)
        scans = SimpleNamespace(images=[image] * 13, folder=[0] * 3 + [1] * 10)
        keys = [key for batch in BatchesBySensor(scans, 2, 1, [8, 4]).batches() for key in batch]
        times = np.bincount([index for index, _ in keys], minlength=13)
        self.assertEqual((times[:3].sum(), times[3:].sum()), (8, 4))
        self.assertLessEqual(times[:3].max() - times[:3].min(), 1)
        self.assertEqual(len({seed for _, seed in keys}), 12)


class LeavingOut(unittest.TestCase):
    def test_never_trains_on_what_it_scores(self):
        config = {"data": {"train": ["real", "simulated"], "train_sequences": []}}
        changed = fold_config(config, ["00", "07"], ["00", "01", "07", "100"])["data"]
        self.assertEqual(changed["train_sequences"], ["01", "100"])
        self.assertEqual(changed["validation_sequences"], ["00", "07"])
        with self.assertRaises(SystemExit):
            fold_config(config, ["08"], ["00", "01"])

    def test_finds_sequences_of_any_sensor(self):
        with tempfile.TemporaryDirectory() as root:
            for name in ("00", "1000"):
                sequence = Path(root) / "sequences" / name
                for part, size in (("velodyne", 16), ("labels", 4)):
                    (sequence / part).mkdir(parents=True)
                    suffix = ".bin" if part == "velodyne" else ".label"
                    (sequence / part / f"000000{suffix}").write_bytes(bytes(size))
            sensor = "rings: 16\nfov_up_deg: 15\nfov_down_deg: -15\n"
            (Path(root) / "sequences" / "1000" / "sensor.yaml").write_text(sensor)
            image = {"rows": 64, "columns": 512, "fov_up_deg": 3, "fov_down_deg": -25}
            config = {"data": {"train": [root], "train_sequences": []}, "image": image}
            self.assertEqual(sequences_of(config), ["00", "1000"])


if __name__ == "__main__":
    unittest.main()
