"""One robust loss for all measurements that may be wrong."""

from __future__ import annotations

import gtsam

HUBER_WIDTH = 1.345  # in standard deviations: 95 % efficient on Gaussian errors


def huber(noise: gtsam.noiseModel.Base) -> gtsam.noiseModel.Robust:
    """`noise` with Huber's loss on the length of the whitened residual: quadratic up to `HUBER_WIDTH`, then linear."""
    return gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.Huber.Create(HUBER_WIDTH), noise)
