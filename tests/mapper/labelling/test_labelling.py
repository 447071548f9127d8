"""Labels of voxels from several sources."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from thingmap.datasets.truth import NO_OBJECT
from thingmap.mapper.labelling.labelling import label_voxels
from thingmap.mapper.labelling.labelling_config import SourceConfig
from thingmap.mapper.labelling.mrf_config import MrfConfig, Smoothness
from thingmap.mapper.labelling.volumes_evidence import volumes_evidence
from thingmap.mapper.labelling.voxels import Voxels

CLASSES = ("cup", "bowl", "book")
CONFIG = SourceConfig(least=0.01, alpha=0.1)


def make_voxels(cells: np.ndarray, p: np.ndarray, colours: np.ndarray | None = None) -> Voxels:
    """Voxels of a floor, (N, K + 1) probabilities."""
    n = len(cells)
    return Voxels(
        size=0.01,
        cells=cells.astype(np.int32),
        points=(cells + 0.5) * 0.01,
        colours=np.full((n, 3), 80, np.float32) if colours is None else colours.astype(np.float32),
        normals=np.tile(np.float32([0, 0, 1]), (n, 1)),
        log_p=np.log(p).astype(np.float32),
        count=np.ones(n, np.int32),
        views=np.ones(n, np.int32),
    )


def row_of(n: int) -> np.ndarray:
    """(N, 3) cells side by side."""
    return np.column_stack([np.arange(n), np.zeros((n, 2), int)])


def test_without_smoothness_each_voxel_is_its_likeliest_class():
    p = np.array([[0.9, 0.2, 0.1, 0.01], [0.1, 0.3, 0.1, 0.07], [0.01, 0.02, 0.01, 0.1]])
    found = label_voxels(make_voxels(row_of(3), p), MrfConfig(smoothness=Smoothness.NONE))
    assert found.label.tolist() == [0, 1, NO_OBJECT] and found.pairs == 0
    assert found.energy == pytest.approx(-np.log([0.9, 0.3, 0.1]).sum(), rel=1e-5)


def test_evidence_of_several_sources_is_summed():
    voxels = make_voxels(row_of(2), np.array([[0.5, 0.4, 0.01, 0.05], [0.5, 0.4, 0.01, 0.05]]))
    more = np.log([[0.2, 0.3, 0.01, 0.05], [0.01, 0.01, 0.01, 0.12]]).astype(np.float32)
    found = label_voxels(voxels, MrfConfig(smoothness=Smoothness.NONE), more)
    assert found.label.tolist() == [1, NO_OBJECT]  # 0.12 against 0.10; 0.006 against 0.005
    assert found.energy == pytest.approx(-np.log([0.4 * 0.3, 0.05 * 0.12]).sum(), rel=1e-4)


@pytest.mark.parametrize("fast", [False, True])
@pytest.mark.parametrize("smoothness", [Smoothness.NORMALS, Smoothness.COLOUR, Smoothness.POTTS])
def test_neighbours_outvote_one_that_differs(smoothness, fast):
    p = np.tile([0.6, 0.1, 0.01, 0.05], (9, 1))
    p[4] = [0.3, 0.4, 0.01, 0.05]
    voxels = make_voxels(np.column_stack([np.indices((3, 3)).reshape(2, -1).T, np.zeros(9, int)]), p)
    alone = label_voxels(voxels, MrfConfig(smoothness=Smoothness.NONE))
    together = label_voxels(voxels, MrfConfig(smoothness=smoothness, fast=fast))
    assert alone.label[4] == 1 and (together.label == 0).all() and together.pairs == 20


def test_normals_cut_where_a_box_stands_on_the_table():
    """What a detector's box has spilled over the table goes, as it borders on the box in a crease only."""
    wall = np.stack(np.meshgrid([0], np.arange(30), np.arange(12), indexing="ij"), axis=-1).reshape(-1, 3)
    table = np.stack(np.meshgrid(np.arange(1, 15), np.arange(30), [0], indexing="ij"), axis=-1).reshape(-1, 3)
    cells, is_box = np.concatenate([wall, table]), np.arange(len(wall) + len(table)) < len(wall)
    spilled = ~is_box & (cells[:, 0] <= 3)
    p = np.where(is_box[:, None], [0.6, 0.01, 0.01, 0.05], [0.05, 0.01, 0.01, 0.3])
    p[spilled] = [0.3, 0.01, 0.01, 0.2]
    normals = np.where(is_box[:, None], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    normals += np.random.default_rng(3).normal(scale=0.15, size=normals.shape)  # as rough as pixels' are
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    voxels = replace(make_voxels(cells, p), normals=normals.astype(np.float32))
    right = np.where(is_box, 0, NO_OBJECT)
    assert (label_voxels(voxels, MrfConfig()).label == right).all()
    by_potts = label_voxels(voxels, MrfConfig(smoothness=Smoothness.POTTS)).label
    assert (by_potts[spilled] == 0).all()


def test_a_bound_is_told_when_asked_for():
    p = np.random.default_rng(1).uniform(0.05, 0.9, (40, 4))
    voxels = make_voxels(row_of(40), p)
    assert label_voxels(voxels, MrfConfig()).gap is None
    gap = label_voxels(voxels, MrfConfig(smoothness=Smoothness.POTTS, bound_sweeps=20)).gap
    assert gap is not None and 0.0 <= gap < 1e-3  # a chain: the bound is the least energy itself


def test_what_a_voxel_says_itself_stands_beside_its_label():
    p = [[0.7, 0.1, 0.1, 0.2], [0.2, 0.1, 0.1, 0.3], [0.7, 0.1, 0.1, 0.2]]
    voxels = make_voxels(row_of(3), p)
    alone = label_voxels(voxels, MrfConfig(smoothness=Smoothness.NONE))
    assert alone.label.tolist() == [0, NO_OBJECT, 0] and alone.second.tolist() == [NO_OBJECT, 0, NO_OBJECT]
    np.testing.assert_allclose(alone.margin, np.log([3.5, 1.5, 3.5]), rtol=1e-5)
    together = label_voxels(voxels, MrfConfig(smoothness=Smoothness.POTTS, potts_strength=50.0))
    assert together.label.tolist() == [0, 0, 0] and together.second.tolist() == [NO_OBJECT] * 3
    np.testing.assert_allclose(together.margin, np.log([3.5, 1 / 1.5, 3.5]), rtol=1e-5)  # overruled


def test_points_in_a_box_are_of_its_thing_as_far_as_it_is_known(make_thing, make_map):
    sure = {"position_covariance": np.zeros((3, 3)), "size_std": [0.0, 0.0, 0.0], "yaw": 0.0}
    cup = make_thing(1, "cup", 0.9, existence=0.8, position=[0, 0, 1], size=[0.1, 0.1, 0.2], **sure)
    object_map = make_map(cup)  # whose up is the camera's -y: the box is 0.2 m along y
    points = np.array([[0.0, 0.0, 1.0], [0.0, 0.105, 1.0], [0.0, 0.1, 1.0], [0.0, 0.3, 1.0], [0.3, 0.0, 1.0]])
    p = np.exp(volumes_evidence(points, object_map, CLASSES, 0.005, CONFIG))
    np.testing.assert_allclose(p[0], [0.72, 0.08, 0.01, 0.1 * 0.28], rtol=1e-4)
    np.testing.assert_allclose(p[1, 0], 0.72 * norm.cdf(-1.0), rtol=1e-4)
    np.testing.assert_allclose(p[2, 0], 0.72 * 0.5, rtol=1e-4)
    np.testing.assert_allclose(p[3:], [[0.01, 0.01, 0.01, 0.099]] * 2, rtol=1e-4)


def test_sides_that_are_not_known_are_soft(make_thing, make_map):
    cup = make_thing(
        1,
        position=[0, 0, 1],
        position_covariance=np.diag([0.0, 0.0009, 0.0]),
        size=[0.1, 0.1, 0.2],
        size_std=[0.0, 0.0, 0.08],
        existence=1.0,
        yaw=0.0,
    )
    p = np.exp(volumes_evidence(np.array([[0.0, 0.15, 1.0]]), make_map(cup), CLASSES, 1e-6, CONFIG))
    np.testing.assert_allclose(p[0, 0], 0.9 * norm.cdf(-0.05 / 0.05), rtol=1e-3)  # 3-4-5: 0.03 and half of 0.08


def test_where_boxes_overlap_the_greater_probability_counts(make_thing, make_map):
    values = {"position": [0, 0, 1], "size": [0.2, 0.2, 0.2], "existence": 1.0}
    cup, bowl = make_thing(1, "cup", 0.9, **values), make_thing(2, "bowl", 0.7, **values)
    both = make_map(cup, bowl)
    p = np.exp(volumes_evidence(np.array([[0.0, 0.0, 1.0]]), both, CLASSES, 0.005, CONFIG))
    assert p[0, 0] > 0.85 and p[0, 1] == pytest.approx(7 / 9 * p[0, 0], rel=1e-3)


def test_a_map_without_things_makes_all_background(make_map):
    empty = make_map(make_map().things[0])
    p = volumes_evidence(np.full((2, 3), 50.0), empty, CLASSES, 0.005, CONFIG)
    assert p.shape == (2, 4) and (p.argmax(axis=1) == 3).all() and p.dtype == np.float32
