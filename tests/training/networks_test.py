"""The networks have RangeNet++'s parameters."""

import unittest

import torch
from torch import nn

from networks import LightRangeNet, RangeNet, Widen


def parameters(part):
    return sum(p.numel() for p in part.parameters())


class DarkNet(unittest.TestCase):
    def test_has_the_published_number_of_parameters(self):
        small, large = RangeNet(21), RangeNet(53)
        self.assertEqual(parameters(small.backbone), 14_921_120)
        self.assertEqual(parameters(small.decoder), 9_786_080)
        self.assertEqual(parameters(small.head), 5_780)
        self.assertEqual(parameters(large.backbone), 40_585_504)

    def test_names_its_tensors_as_the_checkpoints_do(self):
        state = RangeNet(53).backbone.state_dict()
        self.assertEqual(state["enc3.residual_7.conv1.weight"].shape, (128, 256, 1, 1))
        self.assertIn("enc5.bn.running_var", state)
        decoder = RangeNet(53).decoder.state_dict()
        self.assertEqual(decoder["dec5.upconv.weight"].shape, (1024, 512, 1, 4))

    def test_gives_a_score_a_pixel_at_every_output_stride(self):
        image = torch.randn(1, 5, 4, 64)
        for stride in (32, 16, 8):
            network = RangeNet(21, output_stride=stride).eval()
            self.assertEqual(network(image).shape, (1, 20, 4, 64))


class Light(unittest.TestCase):
    def test_takes_images_of_any_sensor(self):
        network = LightRangeNet(8, [[16, [1, 2], 1], [24, [2, 2], 1]]).eval()
        for rows in (16, 32, 64):
            self.assertEqual(network(torch.randn(1, 5, rows, 64)).shape, (1, 20, rows, 64))


class Widening(unittest.TestCase):
    def test_equals_the_transposed_convolution(self):
        torch.manual_seed(1)
        for kernel, stride, padding in (
            ((2, 2), (2, 2), 0),
            ((1, 2), (1, 2), 0),
            ((1, 4), (1, 2), (0, 1)),
        ):
            widen = Widen(6, 7, kernel, stride, padding)
            x = torch.randn(2, 6, 5, 8)
            torch.testing.assert_close(widen(x), nn.ConvTranspose2d.forward(widen, x))


if __name__ == "__main__":
    unittest.main()
