"""Tables that no detector named: level surfaces of the cloud at a table's height."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from .label_match import ARTICLES
from .level_surfaces import LevelSurface, level_surfaces
from .relation_boxes import UprightBoxes
from .synonyms import normal_words, synonyms

if TYPE_CHECKING:
    from .map_content import MapContent

LOWEST, HIGHEST = 0.3, 1.15  # m above the floor: a low coffee table, a bar
USUAL = 0.74  # m, a dining table's height; taken for all: what is under a lower one is still under its top
HAND_HELD = 1.05  # m: cameras are carried higher than this above the floor, and lower above a table


def means_table(text: str) -> bool:
    """Whether the last words of `text` are one for a table: "the table", "my white desk"."""
    words = tuple(word for word in normal_words(text) if word not in ARTICLES)
    return any(words[start:] in synonyms().table_tops for start in range(len(words)))


@lru_cache(maxsize=1)  # maps are told apart by identity: the next question to the same one is quick
def table_tops(content: MapContent) -> tuple[LevelSurface, ...]:
    """Level surfaces of the map's cloud at a table's height above the floor, in the upright frame; the lowest first.

    The floor is the lowest level surface. Where nothing but that was seen, it is a table if the camera was carried too
    low above it for a floor, or if nothing is known of the camera.

    Raises:
        InputError: the cloud or the trajectory is damaged.
    """
    from .run_files import RunFiles  # it reads maps, which are built on this

    files, R = RunFiles(content), content.R_world_upright
    found = level_surfaces(files.cloud() @ R.astype(np.float32), files.spacing)
    if not found:
        return ()
    floor = found[0].height
    tops = tuple(one for one in found if LOWEST <= one.height - floor <= HIGHEST)
    if tops or found[-1].height - floor >= LOWEST:
        return tops
    _, poses = files.trajectory()
    carried = np.median(poses[:, :3, 3] @ R[:, 2]) - floor if len(poses) else 0.0
    return found if carried < HAND_HELD else ()


def with_table_tops(boxes: UprightBoxes, tops: tuple[LevelSurface, ...]) -> UprightBoxes:
    """`boxes`, and after them the tables: each of the usual height, on legs, surely there, as exact as its surface."""
    count = len(tops)
    heights = np.array([one.height for one in tops])
    centre = np.column_stack([np.array([one.centre for one in tops]), heights - USUAL / 2.0])
    covariance = np.zeros((count, 3, 3))
    covariance[:, 2, 2] = [one.height_std**2 for one in tops]
    size = np.column_stack([np.array([one.extents for one in tops]), np.full(count, USUAL)])
    yaw = np.array([one.yaw for one in tops])
    return replace(
        boxes,
        centre=np.concatenate([boxes.centre, centre]),
        covariance=np.concatenate([boxes.covariance, covariance]),
        size=np.concatenate([boxes.size, size]),
        size_std=np.concatenate([boxes.size_std, np.zeros((count, 3))]),
        axis=np.concatenate([boxes.axis, np.column_stack([np.cos(yaw), np.sin(yaw)])]),
        existence=np.concatenate([boxes.existence, np.ones(count)]),
        on_legs=np.concatenate([boxes.on_legs, np.ones(count)]),
        on_floor=np.concatenate([boxes.on_floor, np.ones(count)]),
    )
