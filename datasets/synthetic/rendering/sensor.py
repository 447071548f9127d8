"""A structured-light depth camera in the manner of the first Kinect.

References, by their names below:
    Khoshelham and Elberink, Accuracy and Resolution of Kinect Depth Data, Sensors 12, 2012.
    Nguyen, Izadi and Lovell, Modeling Kinect Sensor Noise for Improved 3D Reconstruction and Tracking, 3DIMPVT 2012.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import cv2
import numpy as np
from numba import njit

from ...frame import Intrinsics


@dataclass(frozen=True, slots=True)
class DepthSensor:
    """Effects of the sensor, each with its switch and its numbers.

    Attributes:
        range_limits: readings outside are dropped.
        near: metres, and
        far: metres (Khoshelham and Elberink: usable to about 5 m).
        axial: noise along the ray, before quantisation, of deviation `axial_sigma` * z^2.
        axial_sigma: 1 / metre (Khoshelham and Elberink: 1.425e-3).
        correlation: pixels, width over which axial noise is alike (own choice; the sensor matches windows).
        tilt: further noise on slanted surfaces, deviation `tilt_sigma` / sqrt(z) * (theta / (pi/2 - theta))^2.
        tilt_sigma: metre^1.5 (Nguyen et al.: 1e-4).
        quantised: disparities come in steps of `disparity_step`.
        disparity_step: pixels (1/8, as calibrations of this sensor commonly find).
        baseline: metres between projector and camera (Khoshelham and Elberink: 0.075).
        focal: pixels, of the sensor's own image; with the baseline it turns depth into disparity.
        lateral: edges waver by `lateral_sigma`.
        lateral_sigma: pixels (Nguyen et al.: 0.8 at right angles).
        grazing: dropouts on slanted surfaces, certain below the first of `grazing_cosines`, none above the second.
        grazing_cosines: of the angle between ray and normal; 87 and 80 degrees (own choice).
        edges: dropouts where depth jumps, with chance `edge_chance`.
        edge_jump: share of the depth (own choice).
        edge_chance: probability (own choice).
        shadow: nothing is measured where the projector, to the right of the camera, does not shine (Khoshelham and
            Elberink, section 3.1).
    """

    range_limits: bool = True
    near: float = 0.4
    far: float = 4.5
    axial: bool = True
    axial_sigma: float = 1.425e-3
    correlation: float = 0.6
    tilt: bool = True
    tilt_sigma: float = 1e-4
    quantised: bool = True
    disparity_step: float = 0.125
    baseline: float = 0.075
    focal: float = 525.0
    lateral: bool = True
    lateral_sigma: float = 0.8
    grazing: bool = True
    grazing_cosines: tuple[float, float] = (0.052, 0.174)
    edges: bool = True
    edge_jump: float = 0.04
    edge_chance: float = 0.6
    shadow: bool = True

    def disparity_per_inverse_depth(self) -> float:
        """Pixels times metres: disparity = this / depth."""
        return self.focal * self.baseline


SWITCHES = tuple(field.name for field in fields(DepthSensor) if isinstance(field.default, bool))  # one an effect
IDEAL = replace(DepthSensor(), **dict.fromkeys(SWITCHES, False))


def measure(
    depth: np.ndarray, incidence: np.ndarray, intrinsics: Intrinsics, sensor: DepthSensor, rng: np.random.Generator
) -> np.ndarray:
    """What the sensor reads.

    Args:
        depth: (H, W) float32 true depth, metres; 0 where there is nothing.
        incidence: (H, W) float32 cosine between ray and normal.
        intrinsics: of the image.
        sensor: its effects.
        rng: consumed alike whatever is switched on.

    Returns:
        (H, W) float32 metres, 0 = no reading.
    """
    shape = depth.shape
    half = ((shape[0] + 1) // 2, (shape[1] + 1) // 2)
    along = _correlated(rng.standard_normal(shape, dtype=np.float32), sensor.correlation)
    coarse = rng.standard_normal((2, *half), dtype=np.float32)  # edges waver over a couple of pixels
    chance = rng.random(shape, dtype=np.float32)
    across, down = (cv2.resize(field, shape[::-1], interpolation=cv2.INTER_NEAREST) for field in coarse)

    seen, cosine = depth, incidence
    if sensor.lateral:
        seen, cosine = _shifted(depth, incidence, across, down, sensor.lateral_sigma)
    sigma = (sensor.axial_sigma if sensor.axial else 0.0, sensor.tilt_sigma if sensor.tilt else 0.0)
    step = sensor.disparity_step if sensor.quantised else 0.0
    reading = _readings(seen, cosine, along, *sigma, step, sensor.disparity_per_inverse_depth())
    if sensor.grazing:
        low, high = sensor.grazing_cosines
        reading[cosine < low + chance * (high - low)] = 0.0
    if sensor.edges:
        reading[(_jumps(seen) > sensor.edge_jump) & (chance < sensor.edge_chance)] = 0.0
    if sensor.shadow:
        _drop_shadow(reading, depth, intrinsics.fx * sensor.baseline)
    if sensor.range_limits:
        reading[(reading < sensor.near) | (reading > sensor.far)] = 0.0
    return reading


def _correlated(field: np.ndarray, width: float) -> np.ndarray:
    """White noise blurred by a Gaussian of `width` pixels, its variance restored."""
    if width <= 0.0:
        return field
    kernel = cv2.getGaussianKernel(2 * int(np.ceil(3 * width)) + 1, width, cv2.CV_32F)
    return cv2.sepFilter2D(field, -1, kernel, kernel, borderType=cv2.BORDER_REFLECT) / float(np.sum(kernel**2))


def _jumps(depth: np.ndarray) -> np.ndarray:
    """(H, W) largest relative difference of depth within 3 x 3 pixels."""
    window = np.ones((3, 3), np.uint8)
    low = cv2.erode(depth, window)
    return (cv2.dilate(depth, window) - low) / np.maximum(low, 1e-3)


@njit(cache=True, fastmath=True, nogil=True)
def _shifted(depth, incidence, across, down, sigma):
    """Depth and cosine as seen from pixels displaced by noise."""
    height, width = depth.shape
    z = np.empty_like(depth)
    cosine = np.empty_like(incidence)
    for y in range(height):
        for x in range(width):
            column = min(max(int(np.floor(x + sigma * across[y, x] + 0.5)), 0), width - 1)
            row = min(max(int(np.floor(y + sigma * down[y, x] + 0.5)), 0), height - 1)
            z[y, x] = depth[row, column]
            cosine[y, x] = incidence[row, column]
    return z, cosine


@njit(cache=True, fastmath=True, nogil=True)
def _readings(depth, cosine, noise, axial, tilt, step, scale):
    """Depth with noise, as a disparity rounded to `step` pixels (0: not rounded)."""
    out = np.zeros_like(depth)
    for y in range(depth.shape[0]):
        for x in range(depth.shape[1]):
            z = depth[y, x]
            if z <= 0.0:
                continue
            sigma = axial * z * z
            if tilt > 0.0:
                elevation = max(np.arcsin(min(cosine[y, x], np.float32(1.0))), np.float32(0.05))
                slant = (np.float32(np.pi / 2.0) - elevation) / elevation
                sigma += tilt * slant * slant / np.sqrt(z)
            noisy = z + sigma * noise[y, x]
            if step > 0.0 and noisy > 0.0:
                steps = np.floor(scale / (noisy * step) + 0.5)
                noisy = scale / (step * steps) if steps > 0.0 else 0.0
            out[y, x] = max(noisy, 0.0)
    return out


@njit(cache=True, nogil=True)
def _drop_shadow(reading, depth, scale):
    """Clear readings the projector cannot reach.

    Seen from the projector, a pixel at column x and depth z lies at x - scale / z. Going left along a row these
    columns fall, unless something nearer hides the surface.
    """
    for y in range(depth.shape[0]):
        leftmost = np.inf
        for x in range(depth.shape[1] - 1, -1, -1):
            if depth[y, x] <= 0.0:
                continue
            column = x - scale / depth[y, x]
            if column >= leftmost:
                reading[y, x] = 0.0
            else:
                leftmost = column
