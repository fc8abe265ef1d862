"""A network is the same after a detour over a model folder, and can be trained on."""

import tempfile
import unittest
from pathlib import Path

import torch

from model_folder import export_onnx
from networks import LightRangeNet, RangeNet
from warm_start import load_weights

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
        export_onnx(network, self.folder / "model.onnx", 16, 64, True)
        return self.folder

    def test_gives_what_the_model_gives(self):
        for kind in (lambda: LightRangeNet(8, STAGES), lambda: RangeNet(21)):
            network, other = used(kind(), 1), kind()
            images = [torch.randn(4, 5, 16, 64) for _ in range(4)]
            load_weights(other, self.exported(network), images)
            with torch.no_grad():
                expected, found = network(images[0]), other.eval()(images[0])
            torch.testing.assert_close(found, expected, rtol=1e-3, atol=1e-3)

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

    def test_takes_the_best_of_a_run(self):
        network, other = used(LightRangeNet(8, STAGES), 3), LightRangeNet(8, STAGES)
        torch.save({"averaged": network.state_dict()}, self.folder / "best.pt")
        load_weights(other, self.folder / "best.pt", [])
        torch.testing.assert_close(other.state_dict(), network.state_dict())


if __name__ == "__main__":
    unittest.main()
