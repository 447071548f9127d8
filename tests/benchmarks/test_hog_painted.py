"""Halves of objects that are painted over: what is painted, and whether their templates notice."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from hog_job import scores_at
from hog_painted import PaintJob, around, background, paint_scene, painted, painted_table, seen_well
from hog_report import OPPOSITE
from hypothesis import given
from hypothesis import strategies as st
from suite_job import scene_folder
from tiny_hog import SCENE, cells

from thingmap.datasets.frame import Frame, Intrinsics
from thingmap.datasets.open_truth import open_truth
from thingmap.detectors.detections import Part
from thingmap.detectors.hog.model import load_model
from thingmap.detectors.parts import part_box


def noise_frame(seed: int) -> Frame:
    rng = np.random.default_rng(seed)
    color = rng.integers(0, 256, (60, 80, 3), dtype=np.uint8)
    depth = rng.uniform(0.8, 3.0, (60, 80)).astype(np.float32)
    depth[rng.random(depth.shape) < 0.1] = 0.0  # no reading
    return Frame(0, "0", 0.0, color, depth, Intrinsics(80, 60, 70.0, 70.0, 39.5, 29.5), np.eye(4))


def pixels_in(box: np.ndarray) -> np.ndarray:
    """(60, 80) bool: the pixels whose centres are in a box, or on its upper or left edge."""
    y, x = np.mgrid[:60, :80] + 0.5
    return (x >= box[0]) & (x < box[2]) & (y >= box[1]) & (y < box[3])


@given(
    corner=st.tuples(st.floats(0.0, 40.0), st.floats(0.0, 30.0)),
    size=st.tuples(st.floats(4.0, 40.0), st.floats(4.0, 30.0)),
    half=st.sampled_from(list(OPPOSITE)),
    share=st.floats(0.0, 1.0),
    seed=st.integers(0, 100),
)
def test_one_half_is_painted_over_and_nothing_else(corner, size, half: Part, share: float, seed: int) -> None:
    frame, box = noise_frame(seed), np.array([*corner, corner[0] + size[0], corner[1] + size[1]])
    patch = background(frame, box, np.zeros((0, 4)), np.random.default_rng(seed))
    after = painted(frame, box, half, share, patch)
    opposite, own = pixels_in(part_box(box, half)), pixels_in(part_box(box, OPPOSITE[half]))
    changed = after.depth != frame.depth
    assert not (changed & own).any() and not (changed & ~pixels_in(box)).any()
    np.testing.assert_array_equal(after.color[~changed], frame.color[~changed])
    inside = frame.depth[pixels_in(box)]
    assert (after.depth[changed] < inside[inside > 0.0].min()).all() and (after.depth[changed] > 0.0).all()
    # A strip from the far side on, whole lines of pixels, as many as the share says.
    axis = 0 if half in (Part.LEFT, Part.RIGHT) else 1
    lines, side = np.flatnonzero(changed.any(axis=axis)), np.flatnonzero(opposite.any(axis=axis))
    assert abs(len(lines) - share * len(side)) <= 0.5
    first = 0 if half in (Part.LEFT, Part.TOP) else len(side) - len(lines)
    np.testing.assert_array_equal(lines, side[first : first + len(lines)])
    assert changed.sum() * len(side) == opposite.sum() * len(lines)


def test_all_of_a_half_is_painted_with_the_patch() -> None:
    frame, box = noise_frame(0), np.array([10.0, 10.0, 30.0, 26.0])
    patch = np.full((16, 20, 3), 7, dtype=np.uint8)
    for half in OPPOSITE:
        after = painted(frame, box, half, 1.0, patch)
        there = pixels_in(part_box(box, half))
        assert there.sum() == 160 and (after.color[there] == 7).all() and np.ptp(after.depth[there]) == 0.0
    blind = replace(frame, depth=np.zeros_like(frame.depth))
    np.testing.assert_array_equal(painted(blind, box, Part.TOP, 1.0, patch).depth, blind.depth)


def test_background_shows_no_object_where_there_is_room() -> None:
    frame, box = noise_frame(0), np.array([10.0, 10.0, 30.0, 26.0])
    objects = np.array([box, [0.0, 30.0, 80.0, 60.0], [0.0, 0.0, 50.0, 30.0]])
    colors = frame.color.copy()
    colors[:] = 0
    colors[:30, 50:] = 9
    for seed in range(5):
        patch = background(replace(frame, color=colors), box, objects, np.random.default_rng(seed))
        assert patch.shape == (16, 20, 3) and (patch == 9).mean() > 0.6


def test_what_is_around_an_object_is_looked_at_like_the_image(hog_folder: Path, hog_models: dict[str, Path]) -> None:
    truth, model = open_truth(scene_folder(SCENE, hog_folder)), load_model(hog_models["RGB-D"])
    assert truth.sequence is not None
    there = seen_well(truth, 2)
    assert len(there) > 3 and {sitter.frame for sitter in there} <= {0, 2, 4}
    apart = []
    for sitter in there[:6]:
        frame = truth.sequence[sitter.frame]
        cut, corner = around(frame, sitter.box)
        x, y = corner
        height, width = cut.depth.shape
        np.testing.assert_array_equal(cut.color, frame.color[y : y + height, x : x + width])
        assert (cut.intrinsics.width, cut.intrinsics.height) == (width, height)
        point = np.array([[0.1, -0.1, 2.0]])
        np.testing.assert_allclose(cut.intrinsics.project(point) + corner, frame.intrinsics.project(point))
        class_id = np.array([model.classes.index(sitter.label)])
        whole = scores_at(sitter.box[None], class_id, frame, model)
        apart.append(scores_at(sitter.box[None] - np.tile(corner, 2), class_id, cut, model) - whole)
    assert np.abs(apart).mean() < 0.15  # the grids of cells differ


def test_halves_of_a_scene_are_painted_over(hog_folder: Path, hog_models: dict[str, Path]) -> None:
    job = PaintJob(SCENE, 2, hog_models["RGB-D"], hog_folder, 3)
    scores = paint_scene(job)
    assert scores.shape == (3, 4, 5, 5) and (scores >= 0.0).all() and (scores <= 1.0).all()
    np.testing.assert_array_equal(scores, paint_scene(job))
    np.testing.assert_array_equal(scores[:, 1:, 0], scores[:, :1, 0].repeat(3, axis=1))
    for row, half in enumerate(OPPOSITE):
        own = np.abs(scores[:, row, 1, half] - scores[:, row, 0, half]).mean()
        other = np.abs(scores[:, row, 1, OPPOSITE[half]] - scores[:, row, 0, OPPOSITE[half]]).mean()
        assert own > other  # a quarter of the half, on the far side of what the other template looks at
    assert paint_scene(replace(job, most=0)).shape == (0, 4, 5, 5)


def test_the_table_of_painted_halves_tells_templates_apart() -> None:
    scores = np.full((2, 4, 5, 5), 0.5)
    scores[..., Part.WHOLE] = 0.9
    for row, half in enumerate(OPPOSITE):
        scores[:, row, 4, half], scores[:, row, 4, OPPOSITE[half]] = 0.1, 0.4
    shown = {row[1]: row[2:6] for row in cells(painted_table([scores[:1], scores[1:]]))}
    assert shown["0 %"] == shown["75 %"] == ["8", "0.50", "0.50", "0.90"]
    assert shown["100 %"] == ["8", "0.10", "0.40", "0.90"]
    assert "No object" in painted_table([scores[:0]])
