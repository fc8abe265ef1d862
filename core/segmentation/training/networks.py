"""The RangeNet family: DarkNet21 and DarkNet53 as lidar-bonnetal defines them, and light members.

All take range images, N x inputs x rows x columns (range, x, y, z, remission, of six inputs the
slope, normalised), and give class scores (logits), N x classes x rows x columns.
"""

from collections.abc import Sequence
from typing import Any

import torch
from torch import nn
from torch.nn import functional

SLOPE = 0.1  # of every leaky ReLU


def activate(x: torch.Tensor) -> torch.Tensor:
    return functional.leaky_relu(x, SLOPE, inplace=True)


class Widen(nn.ConvTranspose2d):
    """A transposed convolution with kernel = stride, or (1, 4) over (1, 2), computed as an ordinary
    convolution whose channels are laid out side by side: on a processor PyTorch's own takes longer
    than all the rest of the network."""

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        if torch.onnx.is_in_onnx_export():
            return super().forward(x)
        n, _, rows, columns = x.shape
        high, wide = self.stride
        if self.kernel_size == self.stride:
            weight = self.weight.permute(1, 2, 3, 0).reshape(-1, self.in_channels, 1, 1)
        else:
            weight = self._three_wide()
        y = functional.conv2d(x, weight, padding=(0, weight.shape[3] // 2))
        y = y.view(n, self.out_channels, high, wide, rows, columns).permute(0, 1, 4, 2, 5, 3)
        y = y.reshape(n, self.out_channels, high * rows, wide * columns)
        return y if self.bias is None else y + self.bias[:, None, None]

    def _three_wide(self) -> torch.Tensor:
        """Even columns see taps 3 and 1, odd ones 2 and 0."""
        tap = self.weight[:, :, 0].unbind(-1)
        none = torch.zeros_like(tap[0])
        even, odd = torch.stack([tap[3], tap[1], none], -1), torch.stack([none, tap[2], tap[0]], -1)
        weight = torch.stack([even, odd], 2).permute(1, 2, 0, 3)
        return weight.reshape(-1, self.in_channels, 1, 3)


class Block(nn.Module):
    """DarkNet's residual block; the sum stands after the second activation."""

    def __init__(self, channels: int, middle: int, momentum: float) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(channels, middle, 1, bias=False)
        self.bn1 = nn.BatchNorm2d(middle, momentum=momentum)
        self.conv2 = nn.Conv2d(middle, channels, 3, padding=1, bias=False)
        self.bn2 = nn.BatchNorm2d(channels, momentum=momentum)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return activate(self.bn2(self.conv2(activate(self.bn1(self.conv1(x)))))) + x


class EncoderStage(nn.Module):
    """A strided convolution, then residual blocks."""

    def __init__(
        self, inputs: int, outputs: int, stride: Sequence[int], blocks: int, momentum: float
    ) -> None:
        super().__init__()
        self.conv = nn.Conv2d(inputs, outputs, 3, stride=stride, padding=1, bias=False)
        self.bn = nn.BatchNorm2d(outputs, momentum=momentum)
        self.blocks = blocks
        for i in range(blocks):
            self.add_module(f"residual_{i}", Block(outputs, outputs // 2, momentum))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        x = activate(self.bn(self.conv(x)))
        for i in range(self.blocks):
            x = getattr(self, f"residual_{i}")(x)
        return x


class DarkNetDecoderStage(nn.Module):
    """Doubles the width; a stage of stride 1 has a plain convolution in its place."""

    def __init__(self, inputs: int, outputs: int, stride: int, momentum: float) -> None:
        super().__init__()
        if stride == 2:
            self.upconv = Widen(inputs, outputs, (1, 4), (1, 2), (0, 1))
        else:
            self.conv = nn.Conv2d(inputs, outputs, 3, padding=1)
        self.bn = nn.BatchNorm2d(outputs, momentum=momentum)
        self.residual = Block(outputs, inputs, momentum)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        widen = self.upconv if hasattr(self, "upconv") else self.conv
        return self.residual(activate(self.bn(widen(x))))


class DarkNetBackbone(nn.Module):
    BLOCKS = {21: (1, 1, 2, 2, 1), 53: (1, 2, 8, 8, 4)}

    def __init__(
        self, layers: int, strides: list[int], dropout: float, momentum: float, inputs: int
    ) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(inputs, 32, 3, padding=1, bias=False)
        self.bn1 = nn.BatchNorm2d(32, momentum=momentum)
        self.dropout = nn.Dropout2d(dropout)
        for k, (blocks, stride) in enumerate(zip(self.BLOCKS[layers], strides)):
            stage = EncoderStage(32 << k, 64 << k, (1, stride), blocks, momentum)
            self.add_module(f"enc{k + 1}", stage)

    def forward(self, x: torch.Tensor) -> tuple[torch.Tensor, list[torch.Tensor]]:
        x = activate(self.bn1(self.conv1(x)))
        skips = []
        for k in range(1, 6):
            # As in the original, no gradient flows through the skips.
            skips.append(x.detach())
            x = self.dropout(getattr(self, f"enc{k}")(x))
        return x, skips


class DarkNetDecoder(nn.Module):
    def __init__(self, strides: list[int], dropout: float, momentum: float) -> None:
        super().__init__()
        self.strides = strides
        self.dropout = nn.Dropout2d(dropout)
        for k in range(5, 0, -1):
            stage = DarkNetDecoderStage(32 << k, 16 << k, strides[k - 1], momentum)
            self.add_module(f"dec{k}", stage)

    def forward(self, x: torch.Tensor, skips: list[torch.Tensor]) -> torch.Tensor:
        for k in range(5, 0, -1):
            x = getattr(self, f"dec{k}")(x)
            # A stage that does not change the width has no skip.
            if self.strides[k - 1] == 2:
                x = x + skips[k - 1]
        return self.dropout(x)


class RangeNet(nn.Module):
    """RangeNet21 or RangeNet53; parameters are named as in lidar-bonnetal's checkpoint files."""

    def __init__(
        self,
        layers: int = 53,
        classes: int = 20,
        output_stride: int = 32,
        dropout: float = 0.01,
        momentum: float = 0.01,
        inputs: int = 5,
    ) -> None:
        super().__init__()
        strides = [2] * 5
        for k in range(4, -1, -1):
            if 2 ** sum(s == 2 for s in strides) > output_stride:
                strides[k] = 1
        self.backbone = DarkNetBackbone(layers, strides, dropout, momentum, inputs)
        self.decoder = DarkNetDecoder(strides, dropout, momentum)
        self.head = nn.Sequential(nn.Dropout2d(dropout), nn.Conv2d(32, classes, 3, padding=1))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return self.head(self.decoder(*self.backbone(x)))


class LightDecoderStage(nn.Module):
    """Transposed convolution with kernel = stride, plus the skip, then a block."""

    def __init__(self, inputs: int, outputs: int, stride: Sequence[int], momentum: float) -> None:
        super().__init__()
        self.upconv = Widen(inputs, outputs, stride, stride, bias=False)
        self.bn = nn.BatchNorm2d(outputs, momentum=momentum)
        self.residual = Block(outputs, outputs // 2, momentum)

    def forward(self, x: torch.Tensor, skip: torch.Tensor) -> torch.Tensor:
        return self.residual(activate(self.bn(self.upconv(x))) + skip)


class LightRangeNet(nn.Module):
    """A member of the family for two processor cores: it narrows the image at once, and spends
    most of its arithmetic where the image is small.

    `stages` lists [channels, [stride of rows, of columns], blocks] of the encoder.
    """

    def __init__(
        self,
        stem: int,
        stages: list,
        classes: int = 20,
        dropout: float = 0.01,
        momentum: float = 0.01,
        inputs: int = 5,
    ) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(inputs, stem, 3, stride=(1, 2), padding=1, bias=False)
        self.bn1 = nn.BatchNorm2d(stem, momentum=momentum)
        self.encoder = nn.ModuleList()
        self.decoder = nn.ModuleList()
        inputs = stem
        for channels, stride, blocks in stages:
            self.encoder.append(EncoderStage(inputs, channels, stride, blocks, momentum))
            self.decoder.insert(0, LightDecoderStage(channels, inputs, stride, momentum))
            inputs = channels
        self.dropout = nn.Dropout2d(dropout)
        self.head = Widen(stem, classes, (1, 4), (1, 2), (0, 1))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        x = activate(self.bn1(self.conv1(x)))
        skips = []
        for stage in self.encoder:
            skips.append(x)
            x = stage(x)
        x = self.dropout(x)
        for stage, skip in zip(self.decoder, reversed(skips)):
            x = stage(x, skip)
        return self.head(x)


class WithSoftmax(nn.Module):
    """The exported network: probabilities instead of scores."""

    def __init__(self, network: nn.Module) -> None:
        super().__init__()
        self.network = network

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return torch.softmax(self.network(x), dim=1)


def make_network(settings: dict[str, Any], classes: int, inputs: int = 5) -> nn.Module:
    """The network that a configuration's `network` section describes."""
    options = dict(settings)
    kind = options.pop("kind")
    if kind in ("darknet21", "darknet53"):
        return RangeNet(int(kind[len("darknet") :]), classes, inputs=inputs, **options)
    if kind == "light":
        return LightRangeNet(classes=classes, inputs=inputs, **options)
    raise ValueError(f"network.kind is '{kind}'; known are darknet21, darknet53, light")
