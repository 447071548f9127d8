"""Proposals of whole frames."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from thingmap.datasets.frame import Frame
from thingmap.detectors.proposals.config import ProposalConfig
from thingmap.detectors.proposals.joining import joined
from thingmap.detectors.proposals.planes import find_planes
from thingmap.detectors.proposals.point_grid import point_grid
from thingmap.detectors.proposals.proposals import Proposals, find_proposals, kernel_radius
from thingmap.detectors.proposals.segments import connected_pieces

from .conftest import CAMERA, table_depth

THINGS = [(-0.2, 0.65, 0.08, 0.08, 0.11), (0.0, 0.8, 0.1, 0.06, 0.2), (0.2, 0.6, 0.07, 0.07, 0.09)]


def silhouettes(things: list) -> np.ndarray:
    """(M, 240, 320) bool: pixels that change when a thing is taken away."""
    whole = table_depth(things)
    return np.array([whole != table_depth([t for t in things if t != thing]) for thing in things])


def ious(found: Proposals, masks: np.ndarray) -> np.ndarray:
    common = np.array([[(a & b).sum() for b in found.masks] for a in masks])
    return common / (masks.sum(axis=(1, 2))[:, None] + found.masks.sum(axis=(1, 2))[None] - common)


def test_each_thing_on_a_table_is_one_proposal(make_table):
    found = find_proposals(make_table(THINGS))
    iou = ious(found, silhouettes(THINGS))
    assert len(found) == 3
    assert (iou.max(axis=1) > 0.85).all() and len(set(iou.argmax(axis=1))) == 3


def test_boxes_points_and_centroids_are_those_of_the_masks(make_table):
    found = find_proposals(make_table(THINGS))
    assert found.masks.shape == (3, 240, 320)
    assert found.masks.sum(axis=0).max() == 1
    for k, proposal in enumerate(found):
        y, x = np.nonzero(proposal.mask)
        assert proposal.xyxy.tolist() == [x.min(), y.min(), x.max() + 1, y.max() + 1]
        np.testing.assert_allclose(proposal.points.mean(axis=0), proposal.centroid, atol=1e-4)
        uv = CAMERA.project(proposal.points.astype(np.float64))
        assert proposal.mask[uv[:, 1].round().astype(int), uv[:, 0].round().astype(int)].all()
        assert found.centroids[k] == pytest.approx(proposal.centroid)
    with pytest.raises(IndexError, match="there are 3 proposals, asked for 3"):
        found[3]


def test_a_thing_wider_than_the_kernel_is_one_piece(make_table):
    wide = [(0.0, 0.7, 0.27, 0.05, 0.15)]
    config = ProposalConfig()
    found = find_proposals(make_table(wide), config)
    assert ious(found, silhouettes(wide)).max() > 0.85
    apart = find_proposals(make_table(wide), replace(config, least_fold=9.0))
    assert len(apart) > len(found)


def test_two_things_that_touch_are_two(make_table):
    low, high = (0.0, 0.6, 0.08, 0.08, 0.08), (0.0, 0.7, 0.08, 0.08, 0.2)
    found = find_proposals(make_table([low, high]))
    assert (ious(found, silhouettes([low, high])).max(axis=1) > 0.7).all()


def test_the_same_frame_gives_the_same_proposals(make_table):
    rng = np.random.default_rng(1)
    frame = make_table(THINGS)
    frame = replace(frame, depth=frame.depth + rng.normal(size=frame.depth.shape).astype(np.float32) * 0.002)
    a, b = find_proposals(frame), find_proposals(frame)
    for name in ("labels", "xyxy", "centroids", "extents"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


def test_no_depth_and_nothing_but_a_table(make_table):
    empty = replace(make_table([]), depth=np.zeros((240, 320), dtype=np.float32))
    for frame in (empty, make_table([])):
        found = find_proposals(frame)
        assert len(found) == 0 and list(found) == [] and found.masks.shape == (0, 240, 320)


def test_no_camera(make_table):
    frame = make_table([])
    none = replace(frame, depth=np.zeros((0, 0), dtype=np.float32), intrinsics=replace(CAMERA, width=0, height=0))
    assert len(find_proposals(none)) == 0


def test_an_image_of_odd_size(make_table):
    frame = make_table(THINGS)
    small = replace(
        frame,
        color=frame.color[:231, :313],
        depth=frame.depth[:231, :313],
        intrinsics=replace(CAMERA, width=313, height=231),
    )
    found = find_proposals(small)
    assert found.labels.shape == (231, 313) and len(found) == 3
    assert (found.xyxy[:, 2] <= 313).all() and (found.xyxy[:, 3] <= 231).all()


def test_gaps_of_a_registered_depth_image_are_closed(make_table):
    frame = make_table(THINGS)
    gaps = frame.depth.copy()
    gaps[::2] = 0.0
    gaps[:, ::3] = 0.0  # two thirds of the pixels have no reading
    found = find_proposals(replace(frame, depth=gaps))
    assert (ious(found, silhouettes(THINGS)).max(axis=1) > 0.7).all()


def test_radius_follows_the_supports_depth():
    config = replace(ProposalConfig(), min_radius=0.001, max_radius=9.0)
    for height in (0.4, 0.8):
        grid = point_grid(table_depth([], height=height, wall=None), CAMERA, 2, 0.2, 4.0)
        planes = find_planes(grid, CAMERA, config.planes)
        radius = kernel_radius(grid, planes, config)
        assert radius == pytest.approx(config.radius_per_depth * np.median(grid.depth[grid.depth > 0]), rel=0.02)


def test_connected_pieces_against_opencv():
    rng = np.random.default_rng(5)
    labels = (rng.random((40, 50)) < 0.6).astype(np.int32) - 1
    found = connected_pieces(labels, np.ones((40, 50), dtype=np.float32), 0.01, 0.01)
    count, truth = cv2.connectedComponents((labels == 0).astype(np.uint8), connectivity=4)
    assert found.max() + 1 == count - 1
    pairs = np.unique(np.stack([found[labels == 0], truth[labels == 0]]), axis=1)
    assert pairs.shape[1] == count - 1


def test_a_jump_of_depth_parts_a_piece():
    depth = np.ones((10, 10), dtype=np.float32)
    depth[:, 5:] = 1.2
    found = connected_pieces(np.zeros((10, 10), dtype=np.int32), depth, 0.01, 0.01)
    assert np.array_equal(np.unique(found[:, :5]), [0]) and np.array_equal(np.unique(found[:, 5:]), [1])


def test_recorded_frame(real_data):
    from thingmap.datasets.open import open_sequence

    frame: Frame = open_sequence(str(real_data / "redkitchen"))[359]
    found = find_proposals(frame)
    assert found.planes.is_support.any()
    # the mug in the middle of the table, by eye
    centre = found.xyxy[:, :2] / 2 + found.xyxy[:, 2:] / 2
    near = np.linalg.norm(centre - [290, 242], axis=1) < 25
    assert near.any()


def test_too_large_and_too_thin_things_are_left_out(make_table):
    config = ProposalConfig()
    low = find_proposals(make_table(THINGS), replace(config, max_extent=0.19))
    assert len(low) == 2 and sorted(np.unique(low.labels)) == [-1, 0, 1]
    assert (ious(low, silhouettes(THINGS)).max(axis=1) > 0.8).tolist() == [True, False, True]
    assert len(find_proposals(make_table(THINGS), replace(config, min_extent=0.3))) == 0


@pytest.mark.parametrize(("slope", "pieces"), [(0.5, 1), (-0.5, 2), (0.0, 1)])
def test_pieces_are_joined_over_an_edge_and_not_over_a_crease(slope: float, pieces: int):
    x = np.broadcast_to((np.arange(320) - CAMERA.cx) / CAMERA.fx, (240, 320))
    grid = point_grid((1.0 / (1.0 - slope * np.abs(x))).astype(np.float32), CAMERA, 1, 0.2, 4.0)  # z = 1 + slope |X|
    halves = (x > 0).astype(np.int32)
    found = joined(halves, grid, least_fold=-0.35, least_contact=0.3, max_extent=9.0, jump_share=0.01, jump=0.01)
    assert found.max() + 1 == pieces
    apart = joined(halves, grid, least_fold=-0.35, least_contact=0.3, max_extent=0.9, jump_share=0.01, jump=0.01)
    assert apart.max() + 1 == 2


def test_walls_do_not_count_for_the_radius_where_there_is_a_support():
    config = replace(ProposalConfig(), min_radius=0.001, max_radius=9.0)
    grid = point_grid(table_depth([], pitch=0.3, wall=1.0), CAMERA, 2, 0.2, 4.0)
    planes = find_planes(grid, CAMERA, config.planes)
    assert planes.is_support.tolist().count(True) == 1 and len(planes) == 2
    table = float(planes.depths[planes.is_support][0])
    assert kernel_radius(grid, planes, config) == pytest.approx(config.radius_per_depth * table)
