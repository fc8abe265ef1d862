"""Intersection over union, as semantic-kitti-api counts it."""

import numpy as np

from scans import CLASS_NAMES, IGNORED


class Confusion:
    """Counts of (truth, prediction) pairs; pixels without truth are left out."""

    def __init__(self, classes=len(CLASS_NAMES)):
        self.counts = np.zeros((classes, classes), np.int64)

    def add(self, truth, prediction):
        known = truth != IGNORED
        pairs = truth[known].astype(np.int64) * len(self.counts) + prediction[known]
        self.counts += np.bincount(pairs, minlength=self.counts.size).reshape(self.counts.shape)

    def iou(self):
        """One a class; NaN for classes that the truth does not hold."""
        hits = np.diag(self.counts).astype(float)
        union = self.counts.sum(0) + self.counts.sum(1) - hits
        iou = np.where(self.counts.sum(1) > 0, hits / np.maximum(union, 1), np.nan)
        iou[IGNORED] = np.nan
        return iou

    def mean_iou(self):
        return float(np.nanmean(self.iou()))

    def table(self):
        return "  ".join(
            f"{name} {100 * value:.1f}"
            for name, value in zip(CLASS_NAMES, self.iou())
            if not np.isnan(value)
        )
