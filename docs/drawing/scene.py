"""What is drawn, and from where: a run's folder as a scene, and the drawing camera that shows all of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from thingmap.datasets.errors import InputError
from thingmap.datasets.frame import Intrinsics
from thingmap.mapper import Thing
from thingmap.mapper.map.store import OutputFolder

FOCAL = 1.35  # focal length over width: about 40 degrees across
ELEVATION = 38.0  # degrees above the horizontal from which the map is seen by default
ROOM = 0.86  # of the half image that boxes and path may fill; the rest is for tags
NEAREST = 0.3  # metres that the view keeps, at least, from all that it has to show
# RGB, well apart and bright enough for a dark ground; labels get them in alphabetical order
PALETTE = (
    *((77, 163, 255), (255, 176, 46), (72, 212, 132), (255, 99, 132), (186, 134, 255)),
    *((52, 211, 222), (240, 225, 80), (255, 138, 76), (245, 130, 215), (150, 205, 90)),
)
Color = tuple[int, int, int]


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """What is drawn, in map coordinates and metres.

    Attributes:
        R_world_upright: (3, 3) axes of the boxes, up last.
        things: at least one.
        points: (M, 3), at least one, with `colors` (M, 3) uint8 RGB.
        poses: (T, 4, 4) `T_world_camera`, at least one.
    """

    R_world_upright: np.ndarray
    things: tuple[Thing, ...]
    points: np.ndarray
    colors: np.ndarray
    poses: np.ndarray

    @property
    def corners(self) -> np.ndarray:
        """(N, 8, 3) of the boxes."""
        return np.array([thing.corners(self.R_world_upright) for thing in self.things])

    @property
    def extent(self) -> np.ndarray:
        """(K, 3) points that the picture has to show."""
        return np.concatenate([self.corners.reshape(-1, 3), self.poses[:, :3, 3]])

    @property
    def palette(self) -> dict[str, Color]:
        """A colour for every label."""
        labels = sorted({thing.label for thing in self.things})
        return {label: PALETTE[i % len(PALETTE)] for i, label in enumerate(labels)}


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """The drawing camera: (4, 4) `T_world_view`, OpenCV axes, and its intrinsics."""

    T_world_view: np.ndarray
    intrinsics: Intrinsics

    def to_view(self, points: np.ndarray) -> np.ndarray:
        """(N, 3) map coordinates to (N, 3) view coordinates, metres."""
        return (points - self.T_world_view[:3, 3]) @ self.T_world_view[:3, :3]

    def project(self, points: np.ndarray) -> np.ndarray:
        """(N, 3) map coordinates, in front of the view, to (N, 2) pixels."""
        return self.intrinsics.project(self.to_view(points))

    def enlarged(self, times: int) -> View:
        """The same view with `times` as many pixels along each side."""
        k = self.intrinsics
        cx, cy = (k.cx + 0.5) * times - 0.5, (k.cy + 0.5) * times - 0.5
        return View(
            self.T_world_view, Intrinsics(k.width * times, k.height * times, k.fx * times, k.fy * times, cx, cy)
        )


def read_scene(out: Path, min_existence: float = 0.5) -> Scene:
    """What a run left in its folder; raises `InputError` where a file is absent or there is nothing in it to draw."""
    folder = OutputFolder.open(out)
    object_map = folder.read_map()
    things = tuple(thing for thing in object_map.things if thing.existence >= min_existence)
    points, colors = folder.read_cloud()
    _, poses = folder.read_trajectory()
    probable = f"things that exist with a probability of {min_existence:g}"
    for file, expected, found, remedy in (
        (folder.map_file, probable, things, "lower --min-existence or map with --all"),
        (folder.cloud_file, "points", points, "check that the sequence has depth"),
        (folder.trajectory_file, "poses", poses, "write it again with `thingmap run`"),
    ):
        if len(found) == 0:
            raise InputError(file, expected, "none", remedy)
    return Scene(object_map.R_world_upright, things, points, colors, poses)


def choose_view(scene: Scene, width: int, azimuth: float = 0.0, elevation: float = ELEVATION) -> View:
    """The nearest view of all things and the whole path in an image twice as wide as high.

    Args:
        scene: what is to be seen.
        width: pixels.
        azimuth: degrees about up, counterclockwise seen from above; 0 looks as the camera did on average.
        elevation: degrees above the horizontal.
    """
    height = width // 2
    f, cx, cy = FOCAL * width, (width - 1) / 2.0, (height - 1) / 2.0
    R_world_view = scene.R_world_upright @ _axes(scene, azimuth, elevation)
    T_world_view = np.eye(4)
    T_world_view[:3, :3] = R_world_view
    half = ROOM * np.array([width, height]) / (2.0 * f)
    T_world_view[:3, 3] = R_world_view @ _eye(scene.extent @ R_world_view, half)
    return View(T_world_view, Intrinsics(width, height, f, f, cx, cy))


def _axes(scene: Scene, azimuth: float, elevation: float) -> np.ndarray:
    """(3, 3) `R_upright_view`: right, down and forward as columns."""
    gaze = scene.poses[:, :3, 2].mean(axis=0) @ scene.R_world_upright
    if np.hypot(gaze[0], gaze[1]) < 0.1:  # it looked all round, or straight down
        gaze = np.array([0.0, 1.0, 0.0])
    heading, pitch = np.arctan2(gaze[1], gaze[0]) + np.radians(azimuth), np.radians(elevation)
    ahead, right = np.array([np.cos(heading), np.sin(heading), 0.0]), np.array([np.sin(heading), -np.cos(heading), 0.0])
    forward = np.cos(pitch) * ahead - np.sin(pitch) * np.array([0.0, 0.0, 1.0])
    return np.column_stack([right, np.cross(forward, right), forward])


def _eye(extent: np.ndarray, half: np.ndarray) -> np.ndarray:
    """(3,) where to look from, along the view's axes.

    `extent` (K, 3), along the same axes, is to be seen; `half` (2,) are the tangents of half the angles of view.
    """
    centre = (extent.min(axis=0) + extent.max(axis=0)) / 2.0
    distance = 0.0
    for _ in range(20):  # as near as it fits, then sideways until it fits equally well on both sides
        x_y, z = extent[:, :2] - centre[:2], extent[:, 2:] - centre[2]
        distance = max(float(np.max(np.abs(x_y) / half - z)), float(np.max(NEAREST - z)))
        seen = x_y / (z + distance)
        centre[:2] += 0.7 * distance * (seen.min(axis=0) + seen.max(axis=0)) / 2.0
    return centre - [0.0, 0.0, distance]
