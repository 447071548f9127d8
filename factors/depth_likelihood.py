"""How likely the depth readings of a volume are if the object is there (Meger et al., Explicit Occlusion, section 2.2).

The paper takes, for every pixel of the projected volume that is not occluded, a mixture of two Gaussians on the
measured depth less the expected one: one for the error of the sensor, one for the rare outlier. No object is an
ellipsoid, so its error is here that of the sensor and that of the volume's shape. With z the depth read, e the depth
at which the ray enters the volume's bounding box, and d half the volume's depth along the ray through its centre (at
depth Z):

    r = z - e - surface d                            reading less expected depth of the surface
    p(r | object)    = (1 - o) N+(r; 0, s²) + o N+(r; 0, S²)
    p(r | no object) =                          N+(r; 0, S²)
    s² = (misfit d)² + (sensor_noise Z²)²,           S² = s² + wide_sigma²

An outlier is a pixel that shows something else than the object, by a gap of the silhouette or beside a thing that is
smaller than its volume. It reads as if there was no object, so both share one wide Gaussian, and a pixel says at least
log o. N+ is cut off where a pixel would be occluded, at e less the tolerance, and normalised. The log ratio is

    log p(r | object) / p(r | no object) = log(o + gain exp(-sharpness r²)).

The paper multiplies over all pixels. Pixels of one silhouette share the misfit of one volume and the surface of one
thing: they are far from independent, so what is used is their mean.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit


@dataclass(frozen=True, slots=True)
class DepthLikelihood:
    """The mixture's numbers.

    Maximum likelihood on 15 rendered scenes (`synth:survey` at 640x480, three levels of clutter, noise of a
    structured-light camera), every volume counting alike: objects at their true place, and off it as a map is (10 mm
    on each axis, 9 % of each size); against volumes 10-30 cm nearer or farther, on the empty table, in the air, and
    at things of no class. On 12 further scenes the same fit gives 0.38, 0.41, 0.15 and 0.48.

    Attributes:
        surface: of half the depth of the volume, from the entry into its box to the surface that is expected.
        misfit: of half the depth of the volume, standard deviation of the surface about it: shape, pose and size.
        sensor_noise: m at 1 m, growing with z² (Khoshelham and Elberink 2012: 1.425 mm/m² a reading, twice that here
            as everywhere in the mapper).
        outlier: o, share of an object's pixels that show something else.
        wide_sigma: m, of readings where there is no object.
    """

    surface: float = 0.37
    misfit: float = 0.43
    sensor_noise: float = 0.0028
    outlier: float = 0.14
    wide_sigma: float = 0.5

    def __post_init__(self) -> None:
        if not (0.0 < self.outlier < 1.0 and min(self.misfit, self.sensor_noise, self.wide_sigma) > 0.0):
            raise ValueError(
                f"0 < outlier < 1 and misfit, sensor_noise and wide_sigma above 0 expected, but got {self}"
            )

    @property
    def numbers(self) -> tuple[float, float, float, float, float]:
        """The fields in their order, as the kernels take them."""
        surface, misfit = float(self.surface), float(self.misfit)
        return surface, misfit, float(self.sensor_noise), float(self.outlier), float(self.wide_sigma)

    def log_ratio(self, beyond_entry: np.ndarray, half_depth: float, depth: float, tolerance: float) -> np.ndarray:
        """(N,) nats each pixel says for an object, from (N,) metres that its reading lies beyond the box's entry.

        Args:
            beyond_entry: z - e, metres; not below -tolerance, or the pixel is occluded.
            half_depth: d, metres.
            depth: Z of the volume's centre, metres.
            tolerance: metres that a depth may differ there, as in `measure_visibility`.
        """
        offset, gain, sharpness = mixture_terms(self.numbers, float(half_depth), float(depth), float(tolerance))
        return np.log(self.outlier + gain * np.exp(-sharpness * (np.asarray(beyond_entry) - offset) ** 2))


@njit(cache=True)
def mixture_terms(numbers, half_depth, depth, tolerance):
    """What the ratio of one volume's pixels depends on, from `DepthLikelihood.numbers`.

    Returns:
        offset: metres from the box's entry to the expected surface.
        gain, sharpness: the ratio is outlier + gain exp(-sharpness r²); 1/m².
    """
    surface, misfit, sensor_noise, outlier, wide_sigma = numbers
    offset, noise = surface * half_depth, sensor_noise * depth * depth
    narrow = misfit * misfit * half_depth * half_depth + noise * noise
    wide = narrow + wide_sigma * wide_sigma
    cut = offset + tolerance  # below -cut a pixel is occluded
    kept = _share_above(-cut / math.sqrt(wide)) / _share_above(-cut / math.sqrt(narrow))
    return offset, (1.0 - outlier) * math.sqrt(wide / narrow) * kept, 0.5 / narrow - 0.5 / wide


@njit(cache=True)
def _share_above(x):
    """Share of a standard Gaussian above x."""
    return 0.5 * math.erfc(x / math.sqrt(2.0))
