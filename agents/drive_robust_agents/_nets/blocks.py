"""Building blocks of the compact networks: convolutions that fold, a small residual encoder, linear layers.

Every block keeps rows of a batch apart (no statistics across rows outside training) and works in channels-last memory.
Shapes are written (N, ...) for a batch of N. Input images are uint8 with height x width x channel, as the renderer
makes images, so that nothing is copied before the first convolution.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, cast

import torch
from torch import Tensor, nn
from torch.nn import functional
from torch.nn.utils.fusion import fuse_conv_bn_eval

__all__ = [
    "RARE",
    "BasicBlock",
    "ConvBnRelu",
    "ImageNorm",
    "MiniResNet",
    "Mlp",
    "channels_last",
    "fold_batch_norm",
    "mostly_nothing",
]

_MEAN, _DEVIATION = 114.5, 57.6
"""ImageNet's mean and deviation, of 255, equal for all three channels: a constant per channel cannot be vectorised over
channels-last memory, and the convolution with batch normalisation that follows learns the difference.
"""


class ImageNorm(nn.Module):
    """Normalises uint8 RGB (N, H, W, 3) to float32 (N, 3, H, W) in channels-last memory.

    Also (N, cameras, H, W, 3) -> (N * cameras, 3, H, W).
    """

    def forward(self, image: Tensor) -> Tensor:
        """Normalise; a permuted view of height x width x channel memory is channels-last already."""
        planes = image.flatten(0, -4).permute(0, 3, 1, 2)
        return planes.float().sub_(_MEAN).mul_(1.0 / _DEVIATION)


class ConvBnRelu(nn.Module):
    """Convolution (no bias), batch normalisation, optional ReLU: (N, C, H, W) -> (N, out, H / stride, W / stride).

    Kernels are odd, the padding is "same".
    """

    def __init__(self, inputs: int, outputs: int, *, kernel: int = 3, stride: int = 1, relu: bool = True) -> None:
        super().__init__()
        self.conv = nn.Conv2d(inputs, outputs, kernel, stride, kernel // 2, bias=False)
        self.norm: nn.Module = nn.BatchNorm2d(outputs)
        self.relu: nn.Module = nn.ReLU(inplace=True) if relu else nn.Identity()

    def forward(self, x: Tensor) -> Tensor:
        """Convolve, normalise, rectify."""
        y: Tensor = self.relu(self.norm(self.conv(x)))
        return y

    def fold(self) -> None:
        """Put the statistics of the normalisation into the convolution; for inference only, and for good."""
        if isinstance(self.norm, nn.BatchNorm2d):
            self.conv = fuse_conv_bn_eval(self.conv.eval(), self.norm.eval())
            self.norm = nn.Identity()


def fold_batch_norm(net: nn.Module) -> nn.Module:
    """Fold every `ConvBnRelu` in the network, in place, and return it. Outputs change by rounding only."""
    for module in net.modules():
        if isinstance(module, ConvBnRelu):
            module.fold()
    return net


def channels_last(net: nn.Module) -> nn.Module:
    """Lay the network's convolutions out for channels-last maps, in place, and return it."""
    cast("Any", net).to(memory_format=torch.channels_last)
    return net


class BasicBlock(nn.Module):
    """Two 3x3 convolutions around a shortcut: (N, inputs, H, W) -> (N, outputs, H / stride, W / stride)."""

    def __init__(self, inputs: int, outputs: int, *, stride: int = 1) -> None:
        super().__init__()
        self.first = ConvBnRelu(inputs, outputs, stride=stride)
        self.second = ConvBnRelu(outputs, outputs, relu=False)
        same = stride == 1 and inputs == outputs
        self.shortcut: nn.Module = (
            nn.Identity() if same else ConvBnRelu(inputs, outputs, kernel=1, stride=stride, relu=False)
        )

    def forward(self, x: Tensor) -> Tensor:
        """Add the residual and rectify."""
        return functional.relu(self.second(self.first(x)) + self.shortcut(x))


class MiniResNet(nn.Module):
    """A stem convolution (5x5, stride 4), then one `BasicBlock` of stride 2 per width.

    (N, 3, H, W) -> (N, widths[-1], H / total_stride, W / total_stride). Depth-wise convolutions are slower on the
    processors that this is made for.
    """

    def __init__(self, widths: Sequence[int], *, stem: int) -> None:
        super().__init__()
        self.channels = widths[-1]
        self.total_stride = 4 * 2 ** len(widths)
        self.stem = ConvBnRelu(3, stem, kernel=5, stride=4)
        inputs = (stem, *widths[:-1])
        self.blocks = nn.Sequential(*(BasicBlock(i, o, stride=2) for i, o in zip(inputs, widths, strict=True)))

    def forward(self, x: Tensor) -> Tensor:
        """Return the map of features."""
        y: Tensor = self.blocks(self.stem(x))
        return y


class Mlp(nn.Sequential):
    """Linear layers of the sizes given with an activation between them, none after the last: (..., a) -> (..., z).

    The number of inputs of every layer must be a multiple of four. Otherwise the bits of a row depend on its place in
    memory, and the agent cannot be driven in lockstep.
    """

    def __init__(self, *sizes: int, activation: type[nn.Module] = nn.ReLU, last: bool = False) -> None:
        layers: list[nn.Module] = []
        for inputs, outputs in pairwise(sizes):
            layers += [nn.Linear(inputs, outputs), activation()]
        super().__init__(*(layers if last else layers[:-1]))


RARE = -2.2
"""The logit of a probability of 0.1, a good start for focal losses, because most places hold nothing."""


def mostly_nothing(mlp: Mlp, classes: int) -> Mlp:
    """Bias the first `classes` outputs (logits) of an MLP to `RARE`, in place, and return the MLP."""
    last = mlp[-1]
    assert isinstance(last, nn.Linear)
    with torch.no_grad():
        last.bias[:classes] = RARE
    return mlp
