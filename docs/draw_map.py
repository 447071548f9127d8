"""Draws the map that `thingmap run` left in a folder as one PNG, with nothing but numpy and OpenCV.

    uv run python docs/draw_map.py OUT -o docs/tabletop.png

Shown are the coloured cloud, every thing as its upright box with what it probably is and the 2-sigma ellipse of its
position, and the camera's path. What the cloud hides of a box is thin; a doubtful thing is faint.
"""

from __future__ import annotations

import argparse
import struct
import sys
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np

from thingmap.datasets.errors import InputError, UserError
from thingmap.datasets.frame import Intrinsics
from thingmap.mapper import Thing
from thingmap.mapper.map.atomic import write_atomic
from thingmap.mapper.map.boxes import EDGES
from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.trajectory.cloud import voxel_keys

FINE = 2  # everything is drawn so many times larger, then reduced
FOCAL = 1.35  # focal length over width: about 40 degrees across
ELEVATION = 38.0  # degrees above the horizontal from which the map is seen by default
ROOM = 0.86  # of the half image that boxes and path may fill; the rest is for tags
FAINTEST = 0.35  # opacity of the least probable thing; it is the probability otherwise
FRUSTUMS = 6  # cameras drawn along the path
WIDTHS = (320, 4000)  # pixels
# RGB, well apart and bright enough for a dark ground; labels get them in alphabetical order
PALETTE = (
    *((77, 163, 255), (255, 176, 46), (72, 212, 132), (255, 99, 132), (186, 134, 255)),
    *((52, 211, 222), (240, 225, 80), (255, 138, 76), (245, 130, 215), (150, 205, 90)),
)
GROUND_TOP, GROUND_BOTTOM = (44, 51, 63), (17, 20, 26)
WHITE, INK = (242, 245, 250), (20, 23, 29)
Color = tuple[int, int, int]


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

    def ellipse(self, thing: Thing, count: int = 48) -> np.ndarray:
        """(count, 2) pixels on the outline of the thing's 2-sigma ellipse: its covariance, projected to first order."""
        x, y, z = self.to_view(thing.position[None])[0]
        k = self.intrinsics
        jacobian = np.array([[k.fx / z, 0.0, -k.fx * x / z**2], [0.0, k.fy / z, -k.fy * y / z**2]])
        jacobian = jacobian @ self.T_world_view[:3, :3].T
        variances, axes = np.linalg.eigh(jacobian @ thing.position_covariance @ jacobian.T)
        angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
        circle = np.column_stack([np.cos(angle), np.sin(angle)])
        return self.project(thing.position[None]) + circle * 2.0 * np.sqrt(np.maximum(variances, 0.0)) @ axes.T

    def enlarged(self, times: int) -> View:
        """The same view with `times` as many pixels along each side."""
        k = self.intrinsics
        cx, cy = (k.cx + 0.5) * times - 0.5, (k.cy + 0.5) * times - 0.5
        return View(
            self.T_world_view, Intrinsics(k.width * times, k.height * times, k.fx * times, k.fy * times, cx, cy)
        )


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
    size = np.array([width, width // 2])
    intrinsics = Intrinsics(*size.tolist(), FOCAL * width, FOCAL * width, *((size - 1) / 2.0).tolist())
    gaze = scene.poses[:, :3, 2].mean(axis=0) @ scene.R_world_upright
    if np.hypot(gaze[0], gaze[1]) < 0.1:  # it looked all round, or straight down
        gaze = np.array([0.0, 1.0, 0.0])
    heading, pitch = np.arctan2(gaze[1], gaze[0]) + np.radians(azimuth), np.radians(elevation)
    ahead, right = np.array([np.cos(heading), np.sin(heading), 0.0]), np.array([np.sin(heading), -np.cos(heading), 0.0])
    forward = np.cos(pitch) * ahead - np.sin(pitch) * np.array([0.0, 0.0, 1.0])
    R_world_view = scene.R_world_upright @ np.column_stack([right, np.cross(forward, right), forward])

    extent = scene.extent @ R_world_view
    centre, half = (extent.min(axis=0) + extent.max(axis=0)) / 2.0, ROOM * size / (2.0 * intrinsics.fx)
    for _ in range(20):  # as near as it fits, then sideways until it fits equally well on both sides
        x_y, z = extent[:, :2] - centre[:2], extent[:, 2:] - centre[2]
        distance = max(float(np.max(np.abs(x_y) / half - z)), float(np.max(0.3 - z)))
        seen = x_y / (z + distance)
        centre[:2] += 0.7 * distance * (seen.min(axis=0) + seen.max(axis=0)) / 2.0
    T_world_view = np.eye(4)
    T_world_view[:3, :3], T_world_view[:3, 3] = R_world_view, R_world_view @ (centre - [0.0, 0.0, distance])
    return View(T_world_view, intrinsics)


def draw(scene: Scene, view: View) -> tuple[np.ndarray, int]:
    """The picture, (H, W, 3) uint8 RGB, and how many tags found no place in it. All boxes are in front of the view."""
    size = view.intrinsics.width, view.intrinsics.height
    view = view.enlarged(FINE)
    pen = Pen(view, *draw_cloud(scene, view))
    pen.segments(path_segments(scene.poses, 0.05 * float(np.ptp(scene.extent, axis=0).max())), WHITE, 1.3)
    depth = view.to_view(np.array([thing.position for thing in scene.things]))[:, 2]
    things, palette = [scene.things[i] for i in np.argsort(-depth, kind="stable")], scene.palette
    for thing in things:
        corners = thing.corners(scene.R_world_upright)
        pen.segments(corners[EDGES], palette[thing.label], 1.7, max(thing.belief(thing.label), FAINTEST))
    for thing in things:
        pen.area(view.ellipse(thing), palette[thing.label], max(thing.belief(thing.label), FAINTEST))
    boxes = np.array([view.project(thing.corners(scene.R_world_upright)) for thing in things])
    texts = [f"{thing.label} {as_text(thing.belief(thing.label))}" for thing in things]
    missing = pen.tags(texts, [palette[thing.label] for thing in things], boxes)
    return cv2.resize(pen.image, size, interpolation=cv2.INTER_AREA), missing


def as_text(probability: float) -> str:
    """Two digits, and never a certainty that is not there."""
    return ">0.99" if 0.99 < probability < 1.0 else f"{probability:.2f}"


def path_segments(poses: np.ndarray, size: float) -> np.ndarray:
    """(N, 2, 3) line segments: from pose to pose, and some cameras `size` metres deep at equal distances."""
    at = poses[:, :3, 3]
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(at, axis=0), axis=1))])
    chosen = poses[np.unique(np.searchsorted(along, np.linspace(0.0, along[-1], FRUSTUMS)))]
    rim = size * np.array([[-0.6, -0.45, 1.0], [0.6, -0.45, 1.0], [0.6, 0.45, 1.0], [-0.6, 0.45, 1.0]])
    rims = rim @ chosen[:, :3, :3].transpose(0, 2, 1) + chosen[:, None, :3, 3]
    tips = np.broadcast_to(chosen[:, None, :3, 3], rims.shape)
    pairs = [(at[:-1], at[1:]), (tips, rims), (rims, np.roll(rims, 1, axis=1))]
    return np.concatenate([np.stack([a.reshape(-1, 3), b.reshape(-1, 3)], axis=1) for a, b in pairs])


def draw_cloud(scene: Scene, view: View) -> tuple[np.ndarray, np.ndarray]:
    """(H, W, 3) uint8 RGB and (H, W) float32 depth, metres, infinite where there is no point.

    Every point is a disc as wide as the cloud's spacing that faces the view. A first pass finds the nearest disc at
    every pixel, a second averages the discs that lie little behind it.
    """
    k, spacing = view.intrinsics, spacing_of(scene.points)
    shown = in_sight(scene, view, spacing)
    points = view.to_view(scene.points[shown])
    radius = np.clip(0.75 * spacing * k.fx / points[:, 2], FINE, 0.02 * k.width)
    most = int(radius.max(initial=FINE))
    pad = 2 * most + 1  # then no disc leaves the buffer whose centre is at most its radius outside the image
    wide, high = k.width + 2 * pad, k.height + 2 * pad
    column, row = np.round(k.project(points) + pad).astype(np.int64).T
    inside = (column >= most) & (column < wide - most) & (row >= most) & (row < high - most)
    order = np.flatnonzero(inside)[np.argsort(-points[inside, 2], kind="stable")]  # far to near, so small to large
    pixel, z, radius = (row * wide + column)[order], points[order, 2].astype(np.float32), radius[order]
    paint = np.column_stack([scene.colors[shown][order], z, np.ones_like(z)]).astype(np.float32)
    nearest, total = np.full(wide * high, np.inf, dtype=np.float32), np.zeros((wide * high, 5), dtype=np.float32)
    for first, at, _ in disc_pixels(pixel, radius, wide):
        nearer = z[first:] < nearest[at]
        nearest[at[nearer]] = z[first:][nearer]  # the last of several is the nearest
    for first, at, squared in disc_pixels(pixel, radius, wide):
        front = np.flatnonzero(z[first:] < nearest[at] + 1.5 * spacing)
        weight = (1.001 - squared / radius[first:][front] ** 2) ** 2
        total[at[front]] += weight[:, None].astype(np.float32) * paint[first:][front]
    total = total.reshape(high, wide, 5)[pad:-pad, pad:-pad]
    mean = total[..., :4] / np.maximum(total[..., 4:], 1e-9)
    depth = np.where(total[..., 4] > 0.0, mean[..., 3], np.inf).astype(np.float32)
    return shaded(mean[..., :3], depth, scene, view, spacing), depth


def disc_pixels(pixel: np.ndarray, radius: np.ndarray, wide: int) -> Iterator[tuple[int, np.ndarray, int]]:
    """One pixel of all discs at a time: where the discs that have it begin, their flat indices, its squared distance.

    `pixel` (N,) are the centres in an image `wide` pixels wide, `radius` (N,) rises.
    """
    most = int(radius.max(initial=0.0))
    for dy in range(-most, most + 1):
        for dx in range(-most, most + 1):
            first = int(np.searchsorted(radius, np.hypot(dx, dy)))
            yield first, pixel[first:] + dy * wide + dx, dx * dx + dy * dy


def spacing_of(points: np.ndarray) -> float:
    """Metres from a point to its fourth neighbour, the median over some points."""
    fourth = min(4, len(points) - 1)
    some = points[np.linspace(0, len(points) - 1, min(len(points), 100)).astype(int)]
    squares = [np.partition(np.sum((points - point) ** 2, axis=1), fourth)[fourth] for point in some]
    return max(float(np.sqrt(np.median(squares))), 0.001)


def in_sight(scene: Scene, view: View, spacing: float) -> np.ndarray:
    """(M,) bool: points that are not strays, and not of a wall or ceiling between the viewer and the things."""
    _, cell, count = np.unique(voxel_keys(scene.points, 2.5 * spacing), return_inverse=True, return_counts=True)
    depth, height = view.to_view(scene.points)[:, 2], scene.points @ scene.R_world_upright[:, 2]
    corners = scene.corners.reshape(-1, 3)
    tall = height > np.max(corners @ scene.R_world_upright[:, 2]) + 0.05
    before = depth < np.median(view.to_view(corners)[:, 2])
    nearest = max(float(view.to_view(scene.extent)[:, 2].min()) - 0.1, 0.05)
    return (count[cell] >= 3) & (depth > nearest) & ~(before & tall)


def shaded(color: np.ndarray, depth: np.ndarray, scene: Scene, view: View, spacing: float) -> np.ndarray:
    """(H, W, 3) uint8: darker right behind a nearer surface, fading into the ground with distance from the things."""
    k = view.intrinsics
    z = np.minimum(depth, 100.0)
    step = (z - cv2.erode(z, np.ones((5, 5), dtype=np.uint8))) / spacing
    dark = np.where(np.isfinite(depth), 1.0 - 0.35 * np.clip(step / 3.0 - 1.0, 0.0, 1.0), 1.0)
    v, u = np.mgrid[: k.height, : k.width].astype(np.float32)
    points = np.stack([(u - k.cx) / k.fx * z, (v - k.cy) / k.fy * z, z], axis=-1)
    extent = view.to_view(scene.extent)
    centre = np.median(view.to_view(scene.corners.reshape(-1, 3)), axis=0)
    away = np.linalg.norm(points - centre.astype(np.float32), axis=-1)
    away = np.clip(away / np.linalg.norm(extent - centre, axis=1).max() - 0.75, 0.0, 1.0)
    fade = np.where(np.isfinite(depth), 0.7 * away * away * (3.0 - 2.0 * away), 1.0)[..., None]
    ground = np.linspace(GROUND_TOP, GROUND_BOTTOM, k.height)[:, None]
    return np.clip(color * dark[..., None] * (1.0 - fade) + ground * fade, 0.0, 255.0).astype(np.uint8)


class Pen:
    """Draws on the enlarged picture; widths are in pixels of a finished picture 1600 wide."""

    def __init__(self, view: View, image: np.ndarray, depth: np.ndarray) -> None:
        self.view, self.image, self.depth = view, image, depth
        self.unit = view.intrinsics.width / 1600.0

    def segments(self, ends: np.ndarray, color: Color, width: float, opacity: float = 1.0) -> None:
        """(N, 2, 3) lines in map coordinates; what the cloud hides of them is thin and faint."""
        hidden: list[np.ndarray] = []
        shown: list[np.ndarray] = []
        for a, b in ends:
            length = float(np.linalg.norm(np.diff(self.view.project(np.stack([a, b])), axis=0)))
            points = a + np.linspace(0.0, 1.0, max(int(length / (2.0 * self.unit)), 2) + 1)[:, None] * (b - a)
            visible, uv = self._visible((points[1:] + points[:-1]) / 2.0), self.view.project(points)
            changes = [0, *(np.flatnonzero(np.diff(visible.astype(int))) + 1).tolist(), len(visible)]
            for start, end in pairwise(changes):
                (shown if visible[start] else hidden).append(uv[start : end + 1])
        self.strokes(hidden, color, 0.6 * width, 0.4 * opacity)
        self.strokes(shown, INK, width + 1.6, 0.4 * opacity)
        self.strokes(shown, color, width, opacity)

    def _visible(self, points: np.ndarray) -> np.ndarray:
        """(N,) bool for points along a line; where the cloud's depth is noise, the neighbours have the majority."""
        column, row = np.round(self.view.project(points)).astype(int).T
        inside = (column >= 0) & (column < self.depth.shape[1]) & (row >= 0) & (row < self.depth.shape[0])
        behind = np.zeros(len(points), dtype=np.float32)
        z = self.view.to_view(points)[:, 2]
        behind[inside] = z[inside] > self.depth[row[inside], column[inside]] + 0.01
        return cv2.blur(behind[None], (9, 1), borderType=cv2.BORDER_REPLICATE)[0] <= 0.5

    def strokes(self, lines: Iterable[np.ndarray], color: Color, width: float, opacity: float = 1.0) -> None:
        """Polylines, each (N, 2) pixels."""
        over = self.image.copy()
        cv2.polylines(over, [fixed(uv) for uv in lines], False, color, max(1, round(width * self.unit)), cv2.LINE_AA, 4)
        cv2.addWeighted(over, opacity, self.image, 1.0 - opacity, 0.0, self.image)

    def area(self, outline: np.ndarray, color: Color, opacity: float) -> None:
        """A (N, 2) polygon with a white rim; its inside lets half of the picture through."""
        over = self.image.copy()
        cv2.fillPoly(over, [fixed(outline)], color, cv2.LINE_AA, 4)
        cv2.addWeighted(over, 0.5 * opacity, self.image, 1.0 - 0.5 * opacity, 0.0, self.image)
        for rim, width in ((INK, 2.6), (WHITE, 1.2)):
            self.strokes([np.concatenate([outline, outline[:1]])], rim, width, opacity)

    def tags(self, texts: list[str], colors: list[Color], boxes: np.ndarray) -> int:
        """A text near each of the (N, 8, 2) projected boxes, tied to it; returns how many did not fit."""
        font, height, pad = cv2.FontFace("sans"), round(17 * self.unit), round(8 * self.unit)
        widths = [cv2.getTextSize((1 << 14, 1 << 9), text, (0, 0), font, height, 500)[2] for text in texts]
        sizes = np.array([(width + 3.6 * pad, height + 1.1 * pad) for width in widths])
        anchors = boxes[:, 4:].mean(axis=1)
        outlines = np.concatenate([boxes.min(axis=1), boxes.max(axis=1)], axis=1)
        places = place_tags(anchors, sizes, outlines, (self.image.shape[1], self.image.shape[0]))
        found = np.flatnonzero(np.isfinite(places[:, 0]))
        for i in found:
            ends = anchors[i, None] if places[i, 3] < anchors[i, 1] else boxes[i]
            ties = np.clip(ends, places[i, :2], places[i, 2:])
            nearest = np.argmin(np.linalg.norm(ties - ends, axis=1))
            leader = np.stack([ends[nearest], ties[nearest]])
            self.strokes([leader], INK, 2.6, 0.4)
            self.strokes([leader], colors[i], 1.2)
        for i in found:
            x0, y0, x1, y1 = np.round(places[i]).astype(int).tolist()
            over, r = self.image.copy(), pad // 2
            low, high = (x0 + r, y0 + r), (x1 - r, y1 - r)
            cv2.rectangle(over, low, high, INK, cv2.FILLED)
            cv2.rectangle(over, low, high, INK, 2 * r, cv2.LINE_AA)  # a wide stroke has round corners
            cv2.addWeighted(over, 0.85, self.image, 0.15, 0.0, self.image)
            dot, baseline = (x0 + round(1.4 * pad), (y0 + y1) // 2), (y0 + y1) // 2 + round(0.36 * height)
            cv2.circle(self.image, dot, round(0.62 * pad), colors[i], cv2.FILLED, cv2.LINE_AA)
            cv2.putText(self.image, texts[i], (x0 + round(2.6 * pad), baseline), WHITE, font, height, 500)
        return len(texts) - len(found)


def fixed(uv: np.ndarray) -> np.ndarray:
    """(N, 2) pixels as OpenCV wants them, in 1/16 pixel."""
    return np.round(uv * 16.0).astype(np.int32)[:, None]


def place_tags(anchors: np.ndarray, sizes: np.ndarray, boxes: np.ndarray, bounds: tuple[int, int]) -> np.ndarray:
    """Where tags go: near their anchors, rather above them, off the boxes if possible, and never on each other.

    Args:
        anchors: (N, 2) pixels; the first ones choose first.
        sizes: (N, 2) width and height of the tags.
        boxes: (N, 4) xyxy of what the tags belong to; better left uncovered, a tag's own a little less so.
        bounds: width and height of the image.

    Returns:
        (N, 4) xyxy, NaN for a tag that found no place.
    """
    places = np.full((len(anchors), 4), np.nan)
    dx, dy = (grid.ravel() for grid in np.meshgrid(np.arange(-12.0, 12.1, 0.5), np.arange(-14.0, 10.1, 0.5)))
    for i, (anchor, size) in enumerate(zip(anchors, sizes, strict=True)):
        unit = size[1]
        low = anchor - size / 2.0 + unit * np.column_stack([dx, dy])
        tried = np.concatenate([low, low + size], axis=1)
        free = np.all(tried[:, :2] >= 0.2 * unit, axis=1) & np.all(
            tried[:, 2:] <= np.array(bounds) - 0.2 * unit, axis=1
        )
        for other in places[np.isfinite(places[:, 0])]:
            free &= overlap(tried, other + 0.15 * unit * np.array([-1.0, -1.0, 1.0, 1.0])) <= 0.0
        covered = sum((overlap(tried, box) for box in boxes), -0.25 * overlap(tried, boxes[i])) / np.prod(size)
        cost = np.hypot(dx, dy) + 2.0 * (dy > -0.5) + 8.0 * covered
        if free.any():
            places[i] = tried[np.argmin(np.where(free, cost, np.inf))]
    return places


def overlap(boxes: np.ndarray, box: np.ndarray) -> np.ndarray:
    """(N,) area that each of the (N, 4) xyxy has in common with one (4,)."""
    sides = np.minimum(boxes[:, 2:], box[2:]) - np.maximum(boxes[:, :2], box[:2])
    return np.prod(np.maximum(sides, 0.0), axis=1)


def encode_png(image: np.ndarray, keep: Iterable[Color] = ()) -> bytes:
    """(H, W, 3) uint8 RGB as a PNG of 256 colours, those to `keep` among them: a quarter of the size of one with all.

    OpenCV chooses the colours, but cannot write such a file.
    """
    cv2.setRNGSeed(0)
    pixels, kept = image.reshape(-1, 3).astype(np.float32), np.array([WHITE, INK, *keep], dtype=np.float32)
    sample = pixels[:: max(len(pixels) // 32768, 1)]
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 20, 0.5)
    count, labels = min(256 - len(kept), len(sample)), np.empty(0, dtype=np.int32)
    _, _, centres = cv2.kmeans(sample, count, labels, stop, 1, cv2.KMEANS_PP_CENTERS)
    palette = np.concatenate([kept, np.round(centres)])
    squares = np.sum(palette**2, axis=1)
    index = [np.argmin(squares - 2.0 * row @ palette.T, axis=1) for row in pixels.reshape(image.shape)]
    lines = np.pad(np.array(index, dtype=np.uint8), ((0, 0), (1, 0)))  # each line begins with its filter: none
    height, width = image.shape[:2]
    chunks = {
        b"IHDR": struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0),
        b"PLTE": palette.astype(np.uint8).tobytes(),
        b"IDAT": zlib.compress(lines.tobytes(), 9),
        b"IEND": b"",
    }
    packed = [len(x).to_bytes(4) + kind + x + zlib.crc32(kind + x).to_bytes(4) for kind, x in chunks.items()]
    return b"\x89PNG\r\n\x1a\n" + b"".join(packed)


def main(arguments: list[str] | None = None) -> int:
    """Returns 0, or 2 after one line about a mistake of the user."""
    parser = argparse.ArgumentParser(description="Draw the map that `thingmap run` left in a folder.")
    parser.add_argument("out", metavar="OUT", type=Path, help="folder that `thingmap run` wrote")
    parser.add_argument("-o", "--output", metavar="FILE", type=Path, required=True, help="PNG to write")
    parser.add_argument(
        "--view-from",
        nargs=2,
        type=float,
        default=(0.0, ELEVATION),
        metavar=("AZIMUTH", "ELEVATION"),
        help="degrees: turned from behind the camera, and above the horizontal (default: 0 38)",
    )
    parser.add_argument("--min-existence", metavar="P", type=float, default=0.5, help="leave out what is less probable")
    parser.add_argument("--width", metavar="PIXELS", type=int, default=1600)
    given = parser.parse_args(arguments)
    try:
        if given.output.suffix.lower() != ".png":
            raise InputError(given.output, "a name ending in .png", given.output.name, "choose another name")
        if not WIDTHS[0] <= given.width <= WIDTHS[1]:
            raise UserError(f"--width: expected {WIDTHS[0]} to {WIDTHS[1]}, found {given.width}; change it")
        if not 0.0 <= given.view_from[1] <= 90.0:
            raise UserError(f"--view-from: expected an elevation from 0 to 90, found {given.view_from[1]:g}; change it")
        scene = read_scene(given.out, given.min_existence)
        image, missing = draw(scene, choose_view(scene, given.width, *given.view_from))
        write_atomic(given.output, encode_png(image, scene.palette.values()))
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    left_out = f", {missing} tags left out for lack of room" if missing else ""
    print(f"{len(scene.things)} things{left_out}; {given.output} has {given.output.stat().st_size / 1000:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
