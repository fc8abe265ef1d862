"""The weighted cross-entropy, equation (3) of the paper, and the Lovasz-softmax loss."""

import numpy as np
import torch
from torch.nn import functional

from scans import IGNORED


def class_weights(shares: np.ndarray | list[float], kind: str) -> torch.Tensor:
    """Weights against class imbalance; 0 for the ignored class.

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


def weighted_cross_entropy(
    scores: torch.Tensor, target: torch.Tensor, weights: torch.Tensor
) -> torch.Tensor:
    """Mean over the pixels with a class, weighted by class; 0 when there are none."""
    if not (target != IGNORED).any():
        return 0 * scores.sum()
    return functional.cross_entropy(scores, target, weights, ignore_index=IGNORED)


def lovasz_softmax(scores: torch.Tensor, target: torch.Tensor, pixels: int = 16384) -> torch.Tensor:
    """A surrogate for 1 - mIoU (Berman et al., CVPR 2018): the Lovasz extension of the Jaccard
    loss, averaged over the classes in the truth. On a random subset of at most `pixels` pixels,
    since all of them are sorted for every class."""
    known = torch.nonzero(target.flatten() != IGNORED).flatten()
    if known.numel() > pixels:
        known = known[torch.randint(known.numel(), (pixels,), device=known.device)]
    target = target.flatten()[known]
    scores = scores.permute(0, 2, 3, 1).reshape(-1, scores.shape[1])[known]
    probabilities = scores.softmax(1)
    losses = []
    for label in torch.unique(target):
        truth = (target == label).float()
        errors, order = torch.sort((truth - probabilities[:, label]).abs(), descending=True)
        losses.append(errors @ _jaccard_gradient(truth[order]))
    return torch.stack(losses).mean() if losses else 0 * scores.sum()


def _jaccard_gradient(truth: torch.Tensor) -> torch.Tensor:
    """Increment of the Jaccard loss by each pixel, in descending order of errors."""
    left = truth.sum() - truth.cumsum(0)
    union = truth.sum() + (1 - truth).cumsum(0)
    jaccard = 1 - left / union
    return torch.cat([jaccard[:1], jaccard[1:] - jaccard[:-1]])
