"""A scene becomes a picture: the cloud, over it the path, the boxes, the ellipses, the tags."""

from __future__ import annotations

import cv2
import numpy as np

from thingmap.mapper import Thing
from thingmap.mapper.map.boxes import EDGES
from thingmap.mapper.map.text import probability_text

from .cloud import draw_cloud
from .pen import WHITE, Pen, ellipse_outline, path_segments
from .scene import Scene, View
from .tags import write_tags

FINE = 2  # everything is drawn so many times larger, then reduced
FAINTEST = 0.35  # opacity of the least probable thing; it is the probability otherwise
CAMERA = 0.05  # depth of a camera on the path, of the longest side of all that is shown


def draw(scene: Scene, view: View) -> tuple[np.ndarray, int]:
    """The picture, (H, W, 3) uint8 RGB, and how many tags found no place in it. All boxes are in front of the view."""
    size = view.intrinsics.width, view.intrinsics.height
    view = view.enlarged(FINE)
    pen = Pen(view, *draw_cloud(scene, view))
    pen.segments(path_segments(scene.poses, CAMERA * float(np.ptp(scene.extent, axis=0).max())), WHITE, 1.3)
    things = _far_to_near(scene, view)
    palette = scene.palette
    colors = [palette[thing.label] for thing in things]
    beliefs = [thing.belief(thing.label) for thing in things]
    corners = [thing.corners(scene.R_world_upright) for thing in things]
    for box, color, belief in zip(corners, colors, beliefs, strict=True):
        pen.segments(box[EDGES], color, 1.7, max(belief, FAINTEST))
    for thing, color, belief in zip(things, colors, beliefs, strict=True):
        pen.area(ellipse_outline(view, thing), color, max(belief, FAINTEST))
    texts = [f"{thing.label} {probability_text(belief)}" for thing, belief in zip(things, beliefs, strict=True)]
    missing = write_tags(pen, texts, colors, np.array([view.project(box) for box in corners]))
    return cv2.resize(pen.image, size, interpolation=cv2.INTER_AREA), missing


def _far_to_near(scene: Scene, view: View) -> list[Thing]:
    depth = view.to_view(np.array([thing.position for thing in scene.things]))[:, 2]
    return [scene.things[i] for i in np.argsort(-depth, kind="stable")]
