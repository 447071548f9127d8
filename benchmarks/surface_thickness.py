"""How thick surfaces come out when all depth images are put together under a trajectory: no true poses are needed.

    uv run python benchmarks/surface_thickness.py --sequence DIR --trajectory NAME=trajectory.txt ...

A wall is thin. Fused from many depth images it is as thick as the sensor's noise and the errors of the poses make it,
so that of two trajectories the better one gives the thinner walls.

    places     flat patches of single depth images: where they are chosen no pose plays a part, so every trajectory is
               judged at the same ones (fits to the fused cloud would pass over exactly the walls that came out double)
    offsets    (places, frames): the median distance along a patch's normal of the points that a frame puts into the
               cylinder about it; where a frame sees through the patch the surface is elsewhere: the end of the cylinder
    thickness  of a patch that enough frames have seen, over a long enough time: half of what lies between the 16th and
               84th percentile of its offsets (the standard deviation, were they Gaussian); then the median of patches
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence as Items
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from flat_patches import fit_patches, offsets
from results import show_section, table

from thingmap.datasets.errors import UserError
from thingmap.datasets.open import open_sequence
from thingmap.datasets.poses import read_tum_poses
from thingmap.datasets.sequence import Sequence
from thingmap.datasets.views import subset, usable_frames

TITLE = "Surface thickness"
OWN = "the sequence's own poses"


@dataclass(frozen=True, slots=True)
class ThicknessConfig:
    """What is looked at.

    Attributes:
        every: frames from one depth image that is used to the next.
        width: pixels at most; wider images are thinned out.
        radius: m, of a patch; a plane is fitted to it and only it is compared.
        reach: m along the normal to either side: half the length of the cylinder.
        max_range: m, beyond it noise of the sensor (growing with z^2) is all that is seen.
        flatness: rms distance from its plane that a patch may have, m at 1 m, as z^2: 1.5 times a Kinect's noise.
        min_filled: share of a patch's pixels with a reading on its plane.
        min_cosine: between normal and viewing ray; depth at grazing angles is noisy.
        places: patches at most.
        min_frames: that have seen a patch.
        min_span: s between the first and the last of those: neighbouring frames agree under any trajectory.
        seed: of the choice of patches.
    """

    every: int = 4
    width: int = 320
    radius: float = 0.045
    reach: float = 0.10
    max_range: float = 2.5
    flatness: float = 0.0042
    min_filled: float = 0.8
    min_cosine: float = 0.4
    places: int = 3000
    min_frames: int = 8
    min_span: float = 3.0
    seed: int = 0


@dataclass(frozen=True, slots=True)
class Thickness:
    """Of a fused cloud: median in metres (None where no place was seen often enough), and over how many places."""

    median: float | None
    places: int


class FusedSurfaces:
    """The depth images of a sequence with the patches that trajectories are judged at.

    Args:
        sequence: frames that cannot be read are left out.
        config: of the measure.

    Attributes:
        stamps: (F,) seconds of the depth images that are used.

    Raises:
        UserError: no frame can be read, or no depth image shows a flat patch.
    """

    def __init__(self, sequence: Sequence, config: ThicknessConfig | None = None) -> None:
        self._config = config or ThicknessConfig()
        c, k = self._config, sequence.intrinsics
        step = max(1, math.ceil(k.width / c.width))
        frames = usable_frames(subset(sequence, c.every), lambda broken: None)
        images = [(frame.stamp, np.ascontiguousarray(frame.depth[::step, ::step])) for frame in frames]
        if not images:
            raise UserError(f"{sequence.name}: no frame can be read")
        self.stamps = np.array([stamp for stamp, _ in images])
        self._depth = np.stack([depth for _, depth in images])
        self._camera = np.array([k.fx, k.fy, k.cx, k.cy]) / step
        self._choose_places(sequence.name)

    def thickness(self, poses: np.ndarray) -> Thickness:
        """Of the cloud under (F, 4, 4) `T_world_camera` at `stamps`; frames of NaN take no part."""
        offsets, c = self.offsets(poses), self._config
        seen = np.isfinite(offsets)
        first = np.where(seen, self.stamps, np.inf).min(axis=1)
        last = np.where(seen, self.stamps, -np.inf).max(axis=1)
        enough = (seen.sum(axis=1) >= c.min_frames) & (last - first >= c.min_span)
        if not enough.any():
            return Thickness(None, 0)
        low, high = np.nanpercentile(offsets[enough], (16.0, 84.0), axis=1)
        return Thickness(float(np.median((high - low) / 2.0)), int(enough.sum()))

    def offsets(self, poses: np.ndarray) -> np.ndarray:
        """(places, F) metres along each patch's normal at which each frame sees the surface; NaN where it does not."""
        known = np.asarray(np.isfinite(poses).all(axis=(1, 2)))
        R, t = poses[self._owner, :3, :3], poses[self._owner, :3, 3]
        points = np.einsum("nij,nj->ni", R, self._points) + t
        normals = np.einsum("nij,nj->ni", R, self._normals)
        c, result = self._config, np.full((len(points), len(poses)), np.nan)
        for f in np.flatnonzero(known):
            R_camera, origin = poses[f, :3, :3], poses[f, :3, 3]
            in_camera = (points - origin) @ R_camera, normals @ R_camera
            offsets(
                self._depth[f], self._camera, *in_camera, c.radius, c.reach, c.max_range, c.min_cosine, result[:, f]
            )
        result[~known[self._owner]] = np.nan  # a patch of a frame without a pose is nowhere
        return result

    def _choose_places(self, name: str) -> None:
        c, (frames, height, width) = self._config, self._depth.shape
        rng = np.random.default_rng(c.seed)
        tried = 4 * c.places  # most pixels are no flat patch
        pixels = np.stack([rng.integers(0, n, tried) for n in (frames, height, width)], axis=1)
        limits = c.radius, c.max_range, c.flatness, c.min_filled, c.min_cosine
        points, normals = fit_patches(self._depth, self._camera, pixels, *limits)
        flat = np.flatnonzero(np.isfinite(points[:, 0]))[: c.places]
        if len(flat) == 0:
            raise UserError(
                f"{name}: no depth image shows a flat patch of {200 * c.radius:.0f} cm within {c.max_range} m"
            )
        self._owner, self._points, self._normals = pixels[flat, 0], points[flat], normals[flat]


def poses_at(stamps: np.ndarray, trajectory_stamps: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """(F, 4, 4) of (N, 4, 4) `poses` at the same stamps, in any order; NaN where there is none."""
    index = {float(stamp): row for row, stamp in enumerate(trajectory_stamps)}
    result = np.full((len(stamps), 4, 4), np.nan)
    for f, stamp in enumerate(stamps):
        if (row := index.get(float(stamp))) is not None:
            result[f] = poses[row]
    return result


def main(arguments: Items[str] | None = None) -> int:
    """Measure, print, and write if asked to; 2 for a user's mistake."""
    options = _options(arguments)
    try:
        sequence = open_sequence(options.sequence, max_frames=options.frames)
        surfaces = FusedSurfaces(sequence, ThicknessConfig(every=options.every))
        trajectories = (
            {} if sequence.poses is None else {OWN: poses_at(surfaces.stamps, sequence.stamps, sequence.poses)}
        )
        for name, path in options.trajectory:
            trajectories[name] = read_tum_poses(path).at(surfaces.stamps)
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    rows = [(name, *describe(surfaces.thickness(poses))) for name, poses in trajectories.items()]
    head = f"`{sequence.name}`: {len(surfaces.stamps)} depth images of {len(sequence)}."
    show_section(TITLE, f"{head}\n\n{table(('trajectory', 'median thickness, mm', 'places'), rows)}", options.write)
    return 0


def describe(thickness: Thickness) -> tuple[str, str]:
    """Millimetres and number of places, as shown."""
    return "-" if thickness.median is None else f"{1e3 * thickness.median:.2f}", str(thickness.places)


def _named(text: str) -> tuple[str, Path]:
    name, separator, path = text.partition("=")
    if not (name and separator and path):
        raise argparse.ArgumentTypeError(f"expected NAME=FILE, found {text!r}")
    return name, Path(path)


def _options(arguments: Items[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add, files = parser.add_argument, "TUM trajectories to compare, with names; the sequence's own poses come first"
    add("--sequence", required=True, metavar="DIR", help="a sequence of depth images")
    add("--trajectory", nargs="+", type=_named, default=[], metavar="NAME=FILE", help=files)
    add("--every", type=int, default=ThicknessConfig().every, metavar="N", help="use every n-th frame")
    add("--frames", type=int, metavar="N", help="take only the first N frames")
    add("--write", action="store_true", help="put the results into RESULTS.md")
    options = parser.parse_args(arguments)
    if options.every < 1:
        parser.error("--every counts from 1")
    return options


if __name__ == "__main__":
    sys.exit(main())
