"""A candidate's first volume, against the means that need no model: a Kalman position and the boxes' median size."""

from __future__ import annotations

import numpy as np
import pytest

from thingmap.datasets.frame import Frame
from thingmap.detectors.detections import Part
from thingmap.factors.solid import project_solids
from thingmap.mapper.config import LiftingConfig
from thingmap.mapper.estimation.lifting import LiftedDetection, lift_box
from thingmap.mapper.proposals.few_views import Proposal, propose

MUG, BOWL, BOX = 0, 1, 2
LIKELY_MUG = np.array([0.8, 0.15, 0.05])
Observations = list[tuple[np.ndarray, LiftedDetection]]


def half_hidden_mug(tools, seed: int) -> tuple[np.ndarray, Observations]:
    """(3,) true log half-axes, and two views of it from 8 to 20 degrees apart, the same side hidden in both.

    The mug stands at the origin on the table; the boxes reach from its visible part somewhat towards the whole, with
    noise, as the simulated detector's.
    """
    rng = np.random.default_rng(seed)
    log_size = rng.multivariate_normal(tools.priors.mean[MUG + 1], tools.priors.covariance[MUG + 1])
    start, step = rng.uniform(0.0, 360.0), rng.uniform(8.0, 20.0)
    hidden, side = rng.uniform(0.2, 0.45), int(rng.choice([0, 2, 3]))  # left, right or bottom
    observations: Observations = []
    for t in range(2):
        angle, distance = np.deg2rad(start + t * step), rng.uniform(0.9, 1.6)
        T = tools.look_at((distance * np.cos(angle), distance * np.sin(angle), rng.uniform(0.3, 0.7)))
        table = tools.Table([T], ((0.0, 0.0, 0.0), np.exp(log_size), MUG))
        depth = table.depth(0, floor=-float(np.exp(log_size[2])))
        box = project_solids(T, tools.upright, np.zeros((1, 3)), log_size[None], tools.kinect)[0][0]
        extent = np.tile(box[2:] - box[:2], 2)
        visible = box.copy()
        visible[side] += (1.0 if side < 2 else -1.0) * hidden * extent[side]
        v, u = np.mgrid[0:480, 0:640]
        behind = {0: u < visible[0], 2: u > visible[2], 3: v > visible[3]}[side]
        near = (np.abs(u - box[[0, 2]].mean()) < extent[0]) & (np.abs(v - box[[1, 3]].mean()) < extent[1])
        depth = np.where(behind & near, np.float32(distance - 0.25), depth)  # an occluder
        depth = (depth + 0.0014 * depth**2 * rng.standard_normal(depth.shape)).astype(np.float32)
        seen = visible + rng.beta(1.2, 2.6, 4) * (box - visible) + 0.045 * extent * rng.standard_normal(4)
        frame = Frame(t, "f", 0.0, np.zeros((480, 640, 3), np.uint8), depth, tools.kinect)
        detection = lift_box(seen, np.array([0.6, 0.05, 0.02]), frame, LiftingConfig())
        assert isinstance(detection, LiftedDetection)
        observations.append((T, detection))
    return log_size, observations


def propose_mug(tools, observations: Observations, posterior: np.ndarray = LIKELY_MUG) -> Proposal:
    return propose(observations, tools.kinect, tools.upright, tools.priors, posterior)


def test_it_is_nearer_than_kalman_and_median_for_most_seeds(tools):
    nearer = np.zeros(2)
    for seed in range(30):
        log_size, observations = half_hidden_mug(tools, seed)
        information = [np.linalg.inv(T[:3, :3] @ d.covariance() @ T[:3, :3].T) for T, d in observations]
        centres = [T[:3, :3] @ d.centre + T[:3, 3] for T, d in observations]
        fused = sum(L @ c for L, c in zip(information, centres, strict=True))
        kalman = np.linalg.solve(np.sum(information, axis=0), fused)
        width, _, height = np.median(np.log([d.half_extents for _, d in observations]), axis=0)
        proposal = propose_mug(tools, observations)
        nearer[0] += np.linalg.norm(proposal.position) < np.linalg.norm(kalman)
        nearer[1] += np.linalg.norm(proposal.log_size - log_size) < np.linalg.norm([width, width, height] - log_size)
    assert nearer.min() >= 20  # of 30; 100 other seeds gave 86 and 83 of 100


def test_exact_views_give_the_exact_volume(tools):
    table = tools.Table(tools.around(3), ((0.1, 0.0, 0.0), np.exp(tools.priors.mean[BOX + 1]), BOX)).detect_all()
    observations = [(T, d[0]) for T, d in zip(table.cameras, table.detections, strict=True)]
    proposal = propose_mug(tools, observations, np.array([0.1, 0.1, 0.8]))
    np.testing.assert_allclose(proposal.position, [0.1, 0.0, 0.0], atol=5e-3)
    np.testing.assert_allclose(proposal.log_size, tools.priors.mean[BOX + 1], atol=0.1)
    assert proposal.class_id == BOX
    assert np.linalg.eigvalsh(proposal.covariance).min() > 0.0
    assert np.linalg.eigvalsh(proposal.log_size_covariance).min() > 0.0


def test_more_views_are_surer(tools):
    table = tools.Table(tools.around(4), ((0.0, 0.0, 0.0), np.exp(tools.priors.mean[MUG + 1]), MUG)).detect_all()
    observations = [(T, d[0]) for T, d in zip(table.cameras, table.detections, strict=True)]
    few, many = propose_mug(tools, observations[:1]), propose_mug(tools, observations)
    assert np.trace(many.covariance) < 0.7 * np.trace(few.covariance)


def test_halves_of_one_view_go_together(tools):
    """A left and a right half in one view and a left one in another, the views in any order."""
    table = tools.Table(tools.around(2), ((0.0, 0.0, 0.0), np.exp(tools.priors.mean[BOX + 1]), BOX))
    table.detect(0, 0, Part.LEFT)
    table.detect(0, 0, Part.RIGHT)
    table.detect(0, 1, Part.LEFT)
    (a, b), (c,) = table.detections
    one, other = table.cameras
    likely_box = np.array([0.05, 0.05, 0.9])
    apart = propose_mug(tools, [(one, a), (other, c), (one, b)], likely_box)
    np.testing.assert_allclose(apart.position, 0.0, atol=5e-3)
    np.testing.assert_allclose(apart.log_size, tools.priors.mean[BOX + 1], atol=0.1)


def test_the_size_follows_the_likely_class(tools):
    """One blurred box is not enough to know; what it is likely to be decides."""
    _, observations = half_hidden_mug(tools, 1)
    sizes = [propose_mug(tools, observations[:1], p).log_size for p in (np.array([1.0, 0, 0]), np.array([0, 0, 1.0]))]
    assert sizes[1][2] > sizes[0][2] + 0.1  # cereal boxes are higher


def test_equal_arguments_give_equal_results(tools):
    _, observations = half_hidden_mug(tools, 2)
    one, same = propose_mug(tools, observations), propose_mug(tools, observations)
    np.testing.assert_array_equal(one.position, same.position)
    assert one.log_likelihood == same.log_likelihood


def test_no_observations_are_refused(tools):
    with pytest.raises(ValueError, match="at least one"):
        propose_mug(tools, [])
