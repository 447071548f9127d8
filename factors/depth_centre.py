"""The object's centre as depth shows it: a direction and a range from the camera.

    r = [ bearing(X, L) - bearing_measured,  range(X, L) - range_measured ],    cost = rho_Huber(|r|_Sigma)

Depth sees only the near surface, so the centre is better known across the ray than along it. The standard deviations
are divided by sqrt(visibility): of a half hidden object half the pixels vote.
"""

from __future__ import annotations

import gtsam
import numpy as np

from .robust import huber

MIN_VISIBILITY = 0.1  # what is seen less than this is no more vague than this


def depth_centre_factor(
    x_key: int,
    l_key: int,
    center_camera: np.ndarray,
    sigma_tangential_m: float,
    sigma_range_m: float,
    visibility: float = 1.0,
) -> gtsam.BearingRangeFactor3D:
    """Ties a pose and an object's centre by the centre measured in one depth image.

    Args:
        x_key, l_key: keys of a Pose3 T_world_camera and a Point3 (metres).
        center_camera: (3,) metres, camera frame.
        sigma_tangential_m, sigma_range_m: standard deviations of the fully visible object's centre, metres, across
            and along the ray.
        visibility: visible share of the object, 0 to 1; clamped to at least `MIN_VISIBILITY`.

    Raises:
        ValueError: for a centre at the camera or not finite, or a sigma that is not positive.
    """
    center = np.asarray(center_camera, dtype=float)
    distance = float(np.linalg.norm(center)) if center.shape == (3,) else float("nan")
    if not 1e-6 < distance < np.inf:
        raise ValueError(f"center_camera must be a finite point away from the camera, but got {center_camera}")
    if not (0.0 < sigma_tangential_m < np.inf and 0.0 < sigma_range_m < np.inf):
        raise ValueError(f"sigmas must be positive, but got {sigma_tangential_m} and {sigma_range_m}")
    angle = sigma_tangential_m / distance
    sigmas = np.array([angle, angle, sigma_range_m]) / np.sqrt(np.clip(visibility, MIN_VISIBILITY, 1.0))
    noise = huber(gtsam.noiseModel.Diagonal.Sigmas(sigmas))
    return gtsam.BearingRangeFactor3D(x_key, l_key, gtsam.Unit3(center), distance, noise)
