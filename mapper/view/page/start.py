"""From where a page first looks at a map."""

from __future__ import annotations

import numpy as np

ELEVATION = 0.55  # rad above the horizontal, where the camera looked on from one side
ELEVATION_AMONG = 0.85  # rad, where it was among the things: rooms are looked into from above
SMALLEST = 0.3  # m: radius of what is looked at, at least


def start_view(corners: np.ndarray, points: np.ndarray, viewpoints: np.ndarray) -> dict:
    """What to look at and from where: from behind the camera and above it.

    Args:
        corners: (B, 8, 3) of boxes that the map is sure of, metres, upright frame; where there are none, points are
            looked at.
        points: (N, 3) metres, upright frame.
        viewpoints: (V, 3) where the camera was, upright frame.

    Returns:
        target: (3,) metres; radius: metres around it that should be seen; azimuth: rad about up, and elevation: rad
        above the horizontal, of the viewer as seen from the target.
    """
    seen = corners.reshape(-1, 3)
    if len(seen) == 0:
        seen = points[:: max(1, len(points) // 5000)]
    if len(seen) == 0:
        seen = viewpoints if len(viewpoints) else np.zeros((1, 3))
    low, high = np.percentile(seen, 2, axis=0), np.percentile(seen, 98, axis=0)
    target = (low + high) / 2.0
    radius = max(float(np.linalg.norm(high - low)) / 2.0, SMALLEST)
    back = (viewpoints.mean(axis=0) - target)[:2] if len(viewpoints) else np.array([0.0, -1.0])
    among = float(np.linalg.norm(back)) < 0.5 * radius
    azimuth = float(np.arctan2(back[1], back[0])) if np.linalg.norm(back) > 1e-6 else -np.pi / 2.0
    return {
        "target": np.round(target, 4).tolist(),
        "radius": round(radius, 4),
        "azimuth": round(azimuth, 4),
        "elevation": ELEVATION_AMONG if among else ELEVATION,
    }
