"""The weighted cross-entropy, equation (3) of the paper."""

import torch
from torch.nn import functional

from scans import IGNORED


def class_weights(shares, kind):
    """Weights against the imbalance of classes; the ignored class counts nothing.

    `log`: 1 / log(share + 1.02), the form that the paper prints, with the constant that keeps the
    logarithm positive. `inverse`: 1 / (share + 0.001), what lidar-bonnetal computes.
    """
    shares = torch.as_tensor(shares, dtype=torch.float32)
    if kind == "log":
        weights = 1 / torch.log(shares + 1.02)
    elif kind == "inverse":
        weights = 1 / (shares + 0.001)
    else:
        raise ValueError(f"loss.weights is '{kind}'; known are log, inverse")
    weights[IGNORED] = 0
    return weights


def weighted_cross_entropy(scores, target, weights):
    """Mean over the pixels that have a class, each by its class's weight."""
    return functional.cross_entropy(scores, target, weights, ignore_index=IGNORED)
