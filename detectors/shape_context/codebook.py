"""What one class looks like: shape contexts of its training views, and where the object's centre lies from them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .config import LENGTH


@dataclass(frozen=True, slots=True, eq=False)
class Codebook:
    """M descriptors f_i = (d_i, q_i) of one class.

    Lengths are in metres at the object: q_i z_t / f, where q_i are pixels in a training image of focal length f in
    which the object is at depth z_t. In an image of focal length f they are f / z times as many pixels, whatever the
    training image was; the paper's q_i z_t / z and r_t z_t / z.

    Attributes:
        descriptors: (M, LENGTH) float32, each adding up to 1.
        offsets: (M, 2) float32 metres right and down, from the point to the middle of the object's box.
        sizes: (M, 2) float32 metres, width and height of the object's box in the training image.
        radius: metres, r of the descriptors; chosen on a validation set.
        edge_mean: mu of the number of edge points of the object in a training image, at a depth of `depth`.
        edge_std: sigma of the same.
        depth: metres times 1 / focal length in pixels (z_t / f), median of the training images: the scale at which
            edge points are counted.

    Raises:
        ValueError: a shape or number is not as above.
    """

    descriptors: np.ndarray
    offsets: np.ndarray
    sizes: np.ndarray
    radius: float
    edge_mean: float
    edge_std: float
    depth: float

    def __post_init__(self) -> None:
        count = len(self.descriptors)
        for name, columns in (("descriptors", LENGTH), ("offsets", 2), ("sizes", 2)):
            array = np.ascontiguousarray(getattr(self, name), dtype=np.float32)
            if array.shape != (count, columns) or count == 0 or not np.isfinite(array).all():
                raise ValueError(f"{name} must be (M, {columns}) finite numbers, M > 0, but got shape {array.shape}")
            object.__setattr__(self, name, array)
        if (self.descriptors < 0).any() or (self.sizes <= 0).any():
            raise ValueError("descriptors must not be negative, and sizes must be positive")
        for name in ("radius", "edge_mean", "edge_std", "depth"):
            value = float(getattr(self, name))
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be a positive number, but is {value}")
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.descriptors)
