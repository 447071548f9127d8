"""Refinement finds the volume that its detections show."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.detectors.detections import Part
from thingmap.mapper.config import AssociationConfig
from thingmap.mapper.proposals.alignment import energy
from thingmap.mapper.proposals.refinement import geometry_of, refine
from thingmap.mapper.proposals.volumes import Volumes

CONFIG = AssociationConfig()
MUG, BOWL, BOX = 0, 1, 2


def mean_half(tools, k: int) -> np.ndarray:
    return np.exp(tools.priors.mean[k + 1])


def one(position, log_size, class_id: int = MUG) -> Volumes:
    return Volumes(np.array([position], float), np.array([log_size], float), np.array([class_id]))


@pytest.mark.parametrize("start", [(0.03, 0.0, 0.0), (-0.02, 0.03, 0.02), (0.0, 0.0, -0.03)])
def test_it_comes_back_to_the_true_volume(tools, start):
    table = tools.Table(tools.around(5), ((0.0, 0.0, 0.0), mean_half(tools, MUG), MUG)).detect_all()
    begun = one(start, tools.priors.mean[MUG + 1] + [0.3, -0.2, 0.25])
    found = refine(begun, table.packed(), tools.priors, CONFIG, 10)
    np.testing.assert_allclose(found.position[0], 0.0, atol=1e-3)
    np.testing.assert_allclose(found.log_size[0], tools.priors.mean[MUG + 1], atol=0.02)
    assert found.settled[0] and 1 <= found.iterations[0] <= 4
    assert (found.detection_of[0, :, Part.WHOLE] == np.arange(5)).all() and (found.detection_of[0, :, 1:] == -1).all()
    assert found.energy[0] < 1e-2 and np.linalg.eigvalsh(found.covariance[0]).min() > 0.0


@pytest.mark.parametrize("part", [Part.TOP, Part.BOTTOM, Part.LEFT, Part.RIGHT])
def test_boxes_of_halves_show_the_whole(tools, part):
    table = tools.Table(tools.around(5), ((0.0, 0.0, 0.0), mean_half(tools, BOX), BOX))
    for camera in range(5):
        table.detect(0, camera, part)
    begun = one((0.02, -0.02, 0.02), tools.priors.mean[BOX + 1] + 0.15, BOX)
    found = refine(begun, table.packed(), tools.priors, CONFIG, 10)
    assert (found.detection_of[0, :, part] >= 0).all()
    np.testing.assert_allclose(found.position[0], 0.0, atol=2e-3)
    np.testing.assert_allclose(found.log_size[0], tools.priors.mean[BOX + 1], atol=0.03)


def test_each_goes_to_the_detections_of_its_own_object(tools):
    half = mean_half(tools, MUG)
    table = tools.Table(tools.around(4), ((0.0, -0.1, 0.0), half, MUG), ((0.0, 0.1, 0.0), half, MUG)).detect_all()
    size = tools.priors.mean[MUG + 1]
    begun = Volumes.concatenate(one((0.02, -0.08, 0.0), size), one((0.0, 0.12, 0.02), size))
    found = refine(begun, table.packed(), tools.priors, CONFIG, 10)
    np.testing.assert_allclose(found.position, [[0.0, -0.1, 0.0], [0.0, 0.1, 0.0]], atol=1e-3)
    assert not set(found.detection_of[0, :, 0]) & set(found.detection_of[1, :, 0])


def test_what_no_detection_is_near_stays_where_it_was(tools):
    table = tools.Table(tools.around(4), ((0.0, 0.0, 0.0), mean_half(tools, MUG), MUG)).detect_all()
    begun = one((0.6, -0.5, 0.0), tools.priors.mean[MUG + 1])
    found = refine(begun, table.packed(), tools.priors, CONFIG, 10)
    np.testing.assert_array_equal(found.position, begun.position)
    assert found.iterations[0] == 0 and (found.detection_of == -1).all()


def test_one_bad_box_among_five_does_little(tools):
    table = tools.Table(tools.around(5), ((0.0, 0.0, 0.0), mean_half(tools, MUG), MUG))
    for camera in range(5):
        table.detect(0, camera, shift=np.array([12.0, 0.0, 0.0, 0.0]) * (camera == 2))  # its left part is hidden
    found = refine(one((0.02, 0.0, 0.0), tools.priors.mean[MUG + 1]), table.packed(), tools.priors, CONFIG, 10)
    assert np.linalg.norm(found.position[0]) < 0.004


def test_a_cut_side_is_only_a_bound(tools):
    table = tools.Table(tools.around(4), ((0.0, 0.0, 0.0), mean_half(tools, BOX), BOX)).detect_all()
    for view in table.detections:
        view[0].sides_seen[0] = False
        view[0].xyxy[0] += 15.0  # the object reaches further to the left than its box
    found = refine(one((0.01, 0.0, 0.0), tools.priors.mean[BOX + 1], BOX), table.packed(), tools.priors, CONFIG, 10)
    assert np.linalg.norm(found.position[0]) < 0.003


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6), st.sampled_from(list(Part)))
def test_the_gradient_is_that_of_the_energy(tools, offset, part):
    table = tools.Table(tools.around(3), ((0.0, 0.0, 0.0), mean_half(tools, BOX), BOX))
    for camera in range(3):
        table.detect(0, camera, part)
        table.detect(0, camera, shift=3.0)
    views = table.packed()
    chosen = np.full((3, 5), -1)
    chosen[views.view, views.part] = np.arange(len(views.view))
    prior = tools.priors.mean[BOX + 1], np.linalg.inv(tools.priors.covariance[BOX + 1])
    x = np.concatenate([np.array(offset[:3]) * 0.05, tools.priors.mean[BOX + 1] + np.array(offset[3:]) * 0.3])
    H, g, unused = np.empty((6, 6)), np.empty(6), np.empty(6)
    energy(geometry_of(views), prior, chosen, x, H, g, True)
    for i in range(6):
        step = np.eye(6)[i] * 1e-6
        ahead, behind = (energy(geometry_of(views), prior, chosen, x + s, H, unused, False) for s in (step, -step))
        assert (ahead - behind) / 2e-6 == pytest.approx(g[i], rel=1e-3, abs=0.05)


def test_rounds_end_at_the_limit(tools):
    table = tools.Table(tools.around(5), ((0.0, 0.0, 0.0), mean_half(tools, MUG), MUG)).detect_all()
    begun = one((0.05, 0.04, 0.04), tools.priors.mean[MUG + 1] + 0.4)
    whole = refine(begun, table.packed(), tools.priors, CONFIG, 10)
    cut = refine(begun, table.packed(), tools.priors, CONFIG, 1)
    assert cut.iterations[0] == 1 and whole.iterations[0] >= 1
    assert cut.settled[0] == (whole.iterations[0] == 1)
