"""Scoring and suppression: which hypothesis is the better one, and which remain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from thingmap.detectors.detections import Part
from thingmap.mapper.batch.inference import infer_volumes
from thingmap.mapper.batch.scoring import VolumeLikelihood
from thingmap.mapper.batch.suppression import distinct, suppress, unexplained
from thingmap.mapper.config import EvidenceConfig, MapperConfig, ScorePotential
from thingmap.mapper.proposals.refinement import refine
from thingmap.mapper.proposals.volumes import Volumes

CONFIG = MapperConfig()
MUG, BOWL, BOX = 0, 1, 2


def mean_half(tools, k: int) -> np.ndarray:
    return np.exp(tools.priors.mean[k + 1])


def score(
    table,
    tools,
    volumes: Volumes,
    config: EvidenceConfig = CONFIG.evidence,
    potential: ScorePotential = ScorePotential.OCCLUSION,
) -> np.ndarray:
    found = [d for view in table.detections for d in view]
    args = table.packed(), found, tools.model, tools.priors, config, CONFIG.association, potential
    return VolumeLikelihood(*args).score(volumes, table.views()).log_likelihood


def with_detections(table, tools, volumes: Volumes) -> Volumes:
    """Hypotheses where they are, with what detections they would be refined with."""
    found = refine(volumes, table.packed(), tools.priors, CONFIG.association, 10).detection_of
    return replace(volumes, detection_of=found)


def hypotheses(tools, *rows) -> Volumes:
    positions, classes = (np.array(column) for column in zip(*rows, strict=True))
    return Volumes(positions.astype(float), tools.priors.mean[classes + 1], classes)


@pytest.fixture(scope="module")
def mug(tools):
    return tools.Table(tools.around(5), ((0.0, 0.0, 0.0), mean_half(tools, MUG), MUG)).detect_all()


@pytest.mark.parametrize("potential", ScorePotential)
def test_the_truth_is_likelier_than_what_is_beside_it_or_of_another_class(mug, tools, potential):
    rows = ((0.0, 0.0, 0.0), MUG), ((0.03, 0.0, 0.0), MUG), ((0.0, 0.0, 0.06), MUG), ((0.0, 0.0, 0.0), BOWL)
    likelihood = score(mug, tools, with_detections(mug, tools, hypotheses(tools, *rows)), potential=potential)
    assert likelihood[0] > likelihood[1:].max() + 1.0


def test_a_linear_potential_is_the_papers(mug, tools):
    """Of a score, hidden or not: the log ratio of a view's appearance moves by the line's own value."""
    found = [d for view in mug.detections for d in view]
    args = mug.packed(), found, tools.model, tools.priors, CONFIG.evidence, CONFIG.association, ScorePotential.LINEAR
    read = VolumeLikelihood(*args)._score_ratio(0, 0.5)
    np.testing.assert_allclose(read, tools.model.scores.linear(found[0].scores, found[0].part))
    assert np.all(np.abs(read) <= 1.0)


def test_an_object_that_nobody_detects_is_unlikely_unless_hidden(tools):
    undetected = tools.Table(tools.around(3), ((0.0, 0.0, 0.0), mean_half(tools, MUG), MUG))
    wall = [(T[:3, 3] * 0.5, (0.15, 0.15, 0.15), BOX) for T in undetected.cameras]
    hidden = tools.Table(undetected.cameras, ((0.0, 0.0, 0.0), mean_half(tools, MUG), MUG), *wall)
    nothing = replace(hypotheses(tools, ((0.0, 0.0, 0.0), MUG)), detection_of=np.full((1, 3, 5), -1))
    config = EvidenceConfig(depth=False)
    size_only = score(hidden, tools, nothing, config)[0]
    assert score(undetected, tools, nothing, config)[0] < size_only - 2.0
    assert score(undetected, tools, nothing, EvidenceConfig(depth=False, misses=False))[0] == pytest.approx(size_only)
    # without the occlusion term, what is hidden counts as missed
    assert score(hidden, tools, nothing, EvidenceConfig(depth=False, occlusion=False))[0] < size_only - 2.0


def test_space_that_was_seen_through_is_unlikely(tools):
    table = tools.Table(tools.around(3))
    empty = replace(hypotheses(tools, ((0.0, 0.0, 0.0), MUG)), detection_of=np.full((1, 3, 5), -1))
    there = tools.Table(table.cameras, ((0.0, 0.0, 0.0), mean_half(tools, MUG), MUG))
    assert score(table, tools, empty)[0] < score(there, tools, empty)[0] - 3.0
    off = EvidenceConfig(depth=False)
    assert score(table, tools, empty, off)[0] == pytest.approx(score(there, tools, empty, off)[0], abs=0.2)


def test_a_half_speaks_for_what_its_whole_template_misses(tools):
    table = tools.Table(tools.around(3), ((0.0, 0.0, 0.0), mean_half(tools, BOX), BOX))
    table.detect(0, 0, Part.LEFT)
    with_half = with_detections(table, tools, hypotheses(tools, ((0.0, 0.0, 0.0), BOX)))
    assert with_half.detection_of[0, 0, Part.LEFT] == 0
    without = replace(with_half, detection_of=np.full((1, 3, 5), -1))
    assert score(table, tools, with_half)[0] > score(table, tools, without)[0] + 0.5


# -- suppression


def scored(tools, *rows) -> Volumes:
    """(position, class, log likelihood, detections of the whole in two views) each."""
    volumes = hypotheses(tools, *[row[:2] for row in rows])
    detection_of = np.full((len(rows), 2, 5), -1)
    detection_of[:, :, 0] = [row[3] for row in rows]
    likelihood = np.array([row[2] for row in rows], float)
    return replace(volumes, log_likelihood=likelihood, detection_of=detection_of, energy=-likelihood)


def test_the_likelier_of_two_that_overlap_remains(tools):
    volumes = scored(
        tools,
        ((0.0, 0.0, 0.0), MUG, 1.0, (0, 1)),
        ((0.01, 0.0, 0.0), MUG, 5.0, (0, 1)),
        ((1.0, 0, 0), BOX, 2.0, (2, 3)),
    )
    kept = suppress(volumes, tools.upright, 0.25)
    np.testing.assert_array_equal(kept.log_likelihood, [5.0, 2.0])


def test_one_behind_the_other_remain_both(tools):
    """They cover each other in the image of a camera along x."""
    volumes = scored(tools, ((0.0, 0.0, 0.0), MUG, 1.0, (0, 1)), ((0.15, 0.0, 0.0), MUG, 5.0, (2, 3)))
    assert len(suppress(volumes, tools.upright, 0.25)) == 2


def test_overlap_is_taken_along_the_upright_axes(tools):
    """Two flat boxes, one above the other along an upright axis that is the world's x."""
    R = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    flat = np.log([[0.2, 0.2, 0.02]] * 2)
    likelihood, classes = np.array([1.0, 2.0]), np.array([MUG, MUG])
    volumes = Volumes(np.array([[0.0, 0, 0], [0.06, 0, 0]]), flat, classes, log_likelihood=likelihood)
    assert len(suppress(volumes, R, 0.25)) == 2
    assert len(suppress(volumes, np.eye(3), 0.25)) == 1


def test_what_a_better_one_explains_is_no_evidence(tools):
    volumes = scored(
        tools,
        ((0.0, 0.0, 0.0), MUG, 5.0, (0, 1)),
        ((1.0, 0.0, 0.0), MUG, 3.0, (0, 2)),
        ((2.0, 0.0, 0.0), MUG, 1.0, (1, 2)),
    )
    kept = unexplained(volumes)
    np.testing.assert_array_equal(kept.log_likelihood, [5.0, 3.0])
    np.testing.assert_array_equal(kept.detection_of[:, :, 0], [[0, 1], [-1, 2]])
    np.testing.assert_array_equal(volumes.detection_of[1, :, 0], [0, 2])  # the arguments stay as they were


def test_equal_outcomes_count_once(tools):
    rows = [((0.0, 0.0, 0.0), MUG, 1.0, (0, 1)), ((0.0, 0.0, 1e-5), MUG, 2.0, (0, 1))]
    rows += [((0.0, 0.0, 0.0), BOX, 1.0, (0, 1)), ((0.0, 0.0, 0.0), BOX, 1.0, (-1, -1))]
    kept = distinct(scored(tools, *rows))
    assert sorted(zip(kept.class_id, kept.log_likelihood, strict=True)) == [(MUG, 2.0), (BOX, 1.0)]
    empty = Volumes(np.empty((0, 3)), np.empty((0, 3)), np.empty(0, dtype=int), np.empty((0, 2, 5), dtype=int))
    assert len(unexplained(suppress(distinct(empty), tools.upright, 0.25))) == 0


# -- all together


def test_inference_finds_a_cluttered_table(tools):
    half = [mean_half(tools, k) for k in range(3)]
    volumes = [((0.0, -0.2, 0.0), half[MUG], MUG), ((0.0, 0.0, 0.0), half[BOWL], BOWL)]
    volumes += [((0.05, 0.3, 0.1), half[BOX], BOX), ((-0.25, 0.0, 0.0), half[MUG], MUG)]
    table = tools.Table(tools.around(6), *volumes).detect_all()
    result = infer_volumes(table.views(), table.detections, tools.model, tools.priors, CONFIG)
    assert len(result.volumes) == 4
    for volume in result.volumes:
        errors = [np.linalg.norm(volume.position - c) for c, _, _ in table.volumes]
        assert min(errors) < 0.01 and table.volumes[int(np.argmin(errors))][2] == volume.class_id
    summary = result.summary()
    assert summary["samples"] == 300 and summary["sliding_volumes"] > 10
    assert summary["before_suppression"] >= summary["after_suppression"] >= summary["with_own_detections"] == 4
    assert 1 <= summary["iterations_median"] <= summary["iterations_most"] <= 10 and summary["not_settled"] == 0


def test_inference_without_detections_finds_nothing(tools):
    table = tools.Table(tools.around(2))
    result = infer_volumes(table.views(), table.detections, tools.model, tools.priors, CONFIG)
    assert len(result.volumes) == 0 and result.summary()["samples"] == 0
