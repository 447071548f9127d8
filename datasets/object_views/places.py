"""Where in an image an object can be put."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .cutout import RIM, Cutout

STEP = 4  # pixels between the places that are looked at
FLAT = 0.01  # of the distance, by which a surface may bend between two sides of a place
EDGE = 0.06  # of the distance, by which the depth below an object may differ from its foot's


@dataclass(frozen=True, slots=True)
class PlaceConfig:
    """Which places are accepted; all numbers are own choices.

    Attributes:
        scale: least and greatest change of an object's size: enlarged ones are blurred, in depth coarse.
        upright: least cosine between the image's up direction and the normal of what the object stands on; of a table
            it is the cosine of the camera's pitch, of an upright wall it is at most 0 if the camera looks down.
        reach: pixels to either side from which the normal is taken.
        tries: places looked at.
        before: share of the object's pixels that must lie before the background, and
        slack: metres by which one may lie behind it: noise, and the foot's own thickness.
    """

    scale: tuple[float, float] = (0.4, 1.3)
    upright: float = 0.4
    reach: int = 5
    tries: int = 30
    before: float = 0.97
    slack: float = 0.02


DEFAULT_PLACES = PlaceConfig()


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """A cut-out of final size and distance, and the column and row of its upper left pixel in the image."""

    cutout: Cutout
    left: int
    top: int


def standing(
    cutout: Cutout, behind: np.ndarray, zoom: float, focal: float, rng: np.random.Generator, config: PlaceConfig
) -> Placed | None:
    """The object on a level surface of a depth image, whole and before everything there; None where no place is found.

    Args:
        cutout: with depth.
        behind: (H, W) float32 metres, 0 = no reading.
        zoom: focal length of that image over that of the object's.
        focal: pixels, of that image.
        rng: draws the places.
        config: which are accepted.
    """
    foot = cutout.foot()
    if foot is None:
        return None
    column, row, distance = foot
    places = level_places(behind, focal, config)
    near, far = (zoom * distance / scale for scale in reversed(config.scale))
    places = places[(places[:, 2] > near) & (places[:, 2] < far)]
    if len(places) == 0:
        return None
    for right, down, depth in places[rng.integers(len(places), size=config.tries)]:
        scale = zoom * distance / depth
        left, top = round(right - column * scale), round(down - row * scale)
        moved = Placed(cutout.scaled(scale, depth - distance), left, top)
        if _fits(moved, behind, float(depth), config):
            return moved
    return None


def anywhere(cutout: Cutout, size: tuple[int, int], rng: np.random.Generator, config: PlaceConfig) -> Placed | None:
    """As `standing` without depth, in an image of so many rows and columns: any size within limits, and any place."""
    room = np.array(size)
    most = min(config.scale[1], float((room / cutout.coverage.shape).min()))
    if most < config.scale[0]:
        return None
    scale = float(np.exp(rng.uniform(np.log(config.scale[0]), np.log(most))))
    moved = replace(cutout, depth=None).scaled(scale)
    top, left = rng.integers(0, np.maximum(room - moved.coverage.shape, 0) + 1)
    return Placed(moved, int(left), int(top))


def level_places(depth: np.ndarray, focal: float, config: PlaceConfig) -> np.ndarray:
    """(N, 3) column, row and depth of pixels of an image (H, W), on a grid, on whose surface an object can stand.

    The optical axis is taken to meet the image in its middle.
    """
    height, width = depth.shape
    reach = config.reach
    row, column = np.mgrid[reach : height - reach : STEP, reach : width - reach : STEP]

    def point(down: int, right: int) -> np.ndarray:
        z = depth[row + down, column + right]
        x, y = (column + right - (width - 1) / 2.0) * z / focal, (row + down - (height - 1) / 2.0) * z / focal
        return np.stack([x, y, z], axis=-1)

    middle, left, right, above, below = (
        point(*at) for at in ((0, 0), (0, -reach), (0, reach), (-reach, 0), (reach, 0))
    )
    z = middle[..., 2]
    seen = np.min([p[..., 2] for p in (middle, left, right, above, below)], axis=0) > 0.0
    flat = np.ones_like(seen)
    for one, other in ((left, right), (above, below)):
        flat &= np.abs(one[..., 2] + other[..., 2] - 2.0 * z) < FLAT * z
    normal = np.cross(below - above, right - left)  # towards the camera; up is -y
    up = -normal[..., 1] > config.upright * np.linalg.norm(normal, axis=-1)
    chosen = seen & flat & up
    return np.stack([column[chosen], row[chosen], z[chosen]], axis=1)


def _fits(placed: Placed, behind: np.ndarray, distance: float, config: PlaceConfig) -> bool:
    """Whether the object lies whole in the image, before what is there, and does not stick out over an edge."""
    depth = placed.cutout.depth
    assert depth is not None
    height, width = depth.shape
    if min(placed.left, placed.top) < 0:
        return False
    there = behind[placed.top : placed.top + height, placed.left : placed.left + width]
    if there.shape != depth.shape:
        return False
    both = (depth > 0.0) & (there > 0.0)
    if not both.any() or (depth[both] <= there[both] + config.slack).mean() < config.before:
        return False
    ground = there[-RIM - 2 :]
    ground = ground[ground > 0.0]
    return ground.size > 0 and bool((np.abs(ground - distance) < EDGE * distance).mean() >= config.before)
