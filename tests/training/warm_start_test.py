"""A network loaded from a model folder gives the same output, and can be trained further."""

import tempfile
import unittest
from pathlib import Path

import numpy as np
import torch
import yaml

from adjust_prior import adjust, crc32_of, offsets
from model_folder import class_names, describe, export_onnx
from networks import LightRangeNet, RangeNet
from warm_start import check_description, load_weights

STAGES = [[16, [1, 2], 1], [24, [2, 2], 1]]


def used(network, seed):
    """With weights, means and variances as a training leaves them."""
    torch.manual_seed(seed)
    for part in network.modules():
        if isinstance(part, torch.nn.BatchNorm2d):
            torch.nn.init.uniform_(part.weight, 0.5, 1.5)
            torch.nn.init.normal_(part.bias)
            part.momentum = 0.2
    network.train()
    for _ in range(30):
        network(torch.randn(2, 5, 16, 64))
    return network.eval()


class WarmStart(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.folder = Path(scratch.name)

    def exported(self, network):
        export_onnx(network, self.folder / "model.onnx", (5, 16, 64), True)
        return self.folder

    def test_gives_what_the_model_gives(self):
        for kind in (lambda: LightRangeNet(8, STAGES), lambda: RangeNet(21, output_stride=16)):
            network, other = used(kind(), 1), kind()
            images = [torch.randn(4, 5, 16, 64) for _ in range(4)]
            load_weights(other, self.exported(network), images)
            with torch.no_grad():
                expected, found = network(images[0]), other.eval()(images[0])
            torch.testing.assert_close(found, expected, rtol=1e-3, atol=1e-3)

    def test_an_adjusted_prior_changes_the_scores_by_so_much_and_nothing_else(self):
        network = used(LightRangeNet(8, STAGES), 4)
        change = np.linspace(-1, 1, 20).astype(np.float32)
        adjust(self.exported(network), self.folder / "adjusted", change)
        other, images = LightRangeNet(8, STAGES), torch.randn(2, 5, 16, 64)
        load_weights(other, self.folder / "adjusted", [images])
        with torch.no_grad():
            expected = network(images) - torch.from_numpy(change)[:, None, None]
            found = other.eval()(images)
        torch.testing.assert_close(found, expected, rtol=1e-3, atol=1e-3)

    def test_an_adjusted_prior_takes_the_calibration_along(self):
        source = self.exported(used(LightRangeNet(8, STAGES), 4))
        adjusted = self.folder / "adjusted"
        calibration = 'network_crc32: "{}"  # of model.onnx\nranges: {{}}\n'
        (source / "int8.yaml").write_text(calibration.format(crc32_of(source / "model.onnx")))
        for _ in range(2):
            adjust(source, adjusted, np.ones(20, np.float32))
            text = calibration.format(crc32_of(adjusted / "model.onnx"))
            self.assertEqual((adjusted / "int8.yaml").read_text(), text)
            source = adjusted

    def test_a_rare_class_loses_what_its_weight_gave(self):
        change = offsets([0.1, 0.6, 0.3, 0.001], "log", 0.5)
        self.assertEqual((change[0], change[1]), (0, 0))
        expected = 0.5 * np.log(np.log(1.62) / np.log([1.32, 1.021]))
        np.testing.assert_allclose(change[2:], expected, rtol=1e-4)

    def test_batch_norms_fit_the_images(self):
        network, other = used(LightRangeNet(8, STAGES, dropout=0), 2), LightRangeNet(8, STAGES)
        images = torch.randn(8, 5, 16, 64)
        load_weights(other, self.exported(network), [images])
        with torch.no_grad():
            expected = other.eval()(images)
            other.dropout.p = 0
            # In training they take mean and variance from the batch, which is what they were fitted
            # to; those that the model kept are the first network's.
            found = other.train()(images)
        self.assertLess((found - expected).abs().mean(), 0.15 * expected.abs().mean())

    def test_names_what_does_not_fit(self):
        folder = self.exported(LightRangeNet(8, STAGES))
        with self.assertRaisesRegex(ValueError, r"model.onnx: conv1.weight is \(8, 5, 3, 3\)"):
            load_weights(LightRangeNet(16, STAGES), folder, [])
        with self.assertRaisesRegex(ValueError, "nothing for .*encoder.1.residual_1"):
            load_weights(LightRangeNet(8, [[16, [1, 2], 1], [24, [2, 2], 2]]), folder, [])
        with self.assertRaisesRegex(ValueError, "has no part 'conv1'"):
            load_weights(RangeNet(21), folder, [])

    def test_refuses_a_model_that_sees_or_names_otherwise(self):
        image = {"rows": 16, "columns": 64, "fov_up_deg": 3, "fov_down_deg": -25}
        config = {"mean": [12, 11, 0, -1, 0.2], "deviation": [12, 11, 7, 1, 0.2]}

        def check(mean, classes):
            text = describe({}, image, mean, config["deviation"], classes, None)
            (self.folder / "model.yaml").write_text(yaml.safe_dump(text, sort_keys=False))
            check_description(self.folder, config)

        check(config["mean"], class_names())
        with self.assertRaisesRegex(ValueError, "model.yaml: mean is .*11.7"):
            check([11.7, 11, 0, -1, 0.2], class_names())
        with self.assertRaisesRegex(ValueError, "model.yaml: its classes"):
            check(config["mean"], class_names()[::-1])
        check_description(self.folder / "best.pt", config)

    def test_a_channel_that_the_model_does_not_see_counts_for_nothing_at_first(self):
        network, other = used(LightRangeNet(8, STAGES), 4), LightRangeNet(8, STAGES, inputs=6)
        images = torch.randn(2, 6, 16, 64)
        with torch.no_grad():
            expected = network.eval()(images[:, :5])
        load_weights(other, self.exported(network), [images])
        with torch.no_grad():
            found = other.eval()(images)
        torch.testing.assert_close(found, expected, rtol=1e-3, atol=1e-3)
        torch.save({"averaged": network.state_dict()}, self.folder / "best.pt")
        load_weights(other, self.folder / "best.pt", [])
        with torch.no_grad():
            torch.testing.assert_close(other.eval()(images), expected)

    def test_takes_the_best_of_a_run(self):
        network, other = used(LightRangeNet(8, STAGES), 3), LightRangeNet(8, STAGES)
        torch.save({"averaged": network.state_dict()}, self.folder / "best.pt")
        load_weights(other, self.folder / "best.pt", [])
        torch.testing.assert_close(other.state_dict(), network.state_dict())


if __name__ == "__main__":
    unittest.main()
