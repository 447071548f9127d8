"""Voxels that keep only some of many classes: exact while few have been spoken of, and bounded otherwise."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from labelling_problems import SEEDS
from voxel_frames import PointFrame, assert_same, gathered, random_frame, reference

from thingmap.mapper.labelling.voxel_config import VoxelConfig

HERE = np.eye(4)[None]
ROUNDING = 2e-5  # nats


@settings(max_examples=60, deadline=None)
@given(seed=SEEDS, classes=st.integers(3, 40), kept=st.integers(1, 8), speaking=st.integers(0, 40))
def test_no_class_is_off_by_more_than_the_bound(seed: int, classes: int, kept: int, speaking: int) -> None:
    rng = np.random.default_rng(seed)
    frames = [random_frame(rng, classes, 40, speaking=min(speaking, classes)) for _ in range(4)]
    voxels = gathered(frames, VoxelConfig(kept_classes=kept), classes).assemble(HERE)
    for n, (_, one) in enumerate(sorted(reference(frames, 0.01).items())):
        error = 0.0 if voxels.log_p_error is None else float(voxels.log_p_error[n])
        assert np.abs(voxels.log_p[n, :-1] - one["log_p"][:-1]).max() <= error + ROUNDING
        assert voxels.log_p[n, -1] == pytest.approx(one["log_p"][-1], abs=ROUNDING)
        excess = one["excess"]
        assert error * one["count"] <= min(excess.sum() / kept, excess.max(axis=1).sum()) + ROUNDING * one["count"]
        if np.count_nonzero(excess.any(axis=0)) <= kept:
            assert error == 0.0


def test_a_class_that_all_points_believe_in_is_kept_among_many_that_come_and_go() -> None:
    rng = np.random.default_rng(0)
    frames = [random_frame(rng, 80, 300, speaking=4) for _ in range(10)]
    for frame in frames:
        frame.log_p[:, 37] = np.log(0.8)
    voxels = gathered(frames, VoxelConfig(), 80).assemble(HERE)
    often = voxels.count >= 20
    assert often.sum() > 20 and voxels.log_p_error[often].max() > 0.0
    assert (voxels.log_p[often, :80].argmax(axis=1) == 37).all()
    np.testing.assert_allclose(voxels.log_p[often, 37], np.log(0.8), atol=0.01)


def test_few_spoken_of_of_many_are_as_exact_as_all_kept() -> None:
    rng = np.random.default_rng(1)
    frames = [random_frame(rng, 30, 200, speaking=0) for _ in range(5)]
    for frame in frames:
        frame.log_p[:, [2, 17, 29]] = np.log(rng.uniform(0.02, 0.9, (200, 3)))
    some = gathered(frames, VoxelConfig(kept_classes=4), 30).assemble(HERE)
    every = gathered(frames, VoxelConfig(kept_classes=30), 30).assemble(HERE)
    assert some.log_p_error is not None and not some.log_p_error.any()
    assert_same(some, every, 1e-5)


def test_bounds_add_where_submaps_merge() -> None:
    rng = np.random.default_rng(2)
    frames = [random_frame(rng, 20, 200) for _ in range(4)]
    numbered = [PointFrame(k, *frame.arguments()[1:]) for k, frame in enumerate(frames)]
    evidence = gathered(numbered, VoxelConfig(kept_classes=3), 20)
    assert evidence.submaps == (4, 0)
    voxels = evidence.assemble(np.tile(np.eye(4), (4, 1, 1)))
    true = reference(frames, 0.01)
    off, compared = [], 0
    for n, cell in enumerate(map(tuple, voxels.cells.tolist())):
        if cell in true and true[cell]["count"] == voxels.count[n]:  # else a mean lies on the border
            off.append(np.abs(voxels.log_p[n] - true[cell]["log_p"]).max() - voxels.log_p_error[n])
            compared += 1
    assert compared > 0.9 * len(true) and max(off) <= ROUNDING
