"""How things that stand are turned in an image: by the camera's roll, and towards its edges by perspective."""

from __future__ import annotations

import numpy as np

from ...datasets.frame import Intrinsics
from .edge_map import EdgeMap


def local_turn(edges: EdgeMap, intrinsics: Intrinsics, up: np.ndarray) -> np.ndarray:
    """(E,) radians from x towards y, by which a vertical line through each edge point leans from the image's own.

    The training images show things upright; contours of a thing that leans would be other contours. A point X moved up
    by dX = up has the image motion (up_x - up_z x, up_y - up_z y) / z in normalised coordinates (x, y).

    Args:
        edges: E points.
        intrinsics: of the camera.
        up: (3,) unit vector, camera axes.
    """
    x = (edges.columns - intrinsics.cx) / intrinsics.fx
    y = (edges.rows - intrinsics.cy) / intrinsics.fy
    return np.arctan2(up[0] - up[2] * x, -(up[1] - up[2] * y))
