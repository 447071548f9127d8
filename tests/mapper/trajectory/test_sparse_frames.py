"""What links between frames that are far apart lack, from how far independent ones disagree."""

import numpy as np
import pytest

from thingmap.mapper.config import LoopConfig, SparseConfig
from thingmap.mapper.trajectory.rigid import pose_covariance, retracted
from thingmap.mapper.trajectory.sparse_frames import SparseFrames

CLAIMED = pose_covariance((0.001, 0.002))  # rad, m


def frames(interval: float, config: SparseConfig | None = None) -> SparseFrames:
    sparse = SparseFrames(config or SparseConfig())
    for k in range(6):
        sparse.see(k * interval)
    return sparse


def compare(sparse: SparseFrames, turn: float, move: float, count: int, seed: int = 0, claimed=CLAIMED) -> None:
    """Pairs of measurements whose errors have these deviations, rad and m, beside what they claim."""
    rng = np.random.default_rng(seed)
    noise = claimed + pose_covariance((turn, move))
    for _ in range(count):
        T = retracted(np.eye(4), 0.1 * rng.normal(size=6))
        a, b = (retracted(T, rng.multivariate_normal(np.zeros(6), noise)) for _ in range(2))
        sparse.compare(a, claimed, b, claimed)


def sigmas(covariance: np.ndarray) -> np.ndarray:
    return np.sqrt(np.diag(covariance))[[0, 3]]


def test_frames_of_a_video_lack_nothing():
    sparse = frames(1 / 30)
    compare(sparse, 0.02, 0.03, 20)
    assert not sparse.far_apart and not sparse.doubtful
    assert not sparse.missing().any() and not sparse.missing_of_step().any()


def test_one_gap_in_a_video_is_no_sparse_sequence():
    sparse = SparseFrames(SparseConfig())
    for stamp in (0.0, 0.033, 0.066, 1.5, 1.533, 1.566):
        sparse.see(stamp)
    assert not sparse.far_apart


def test_before_anything_is_compared_the_prior_holds():
    config = SparseConfig(prior=(0.01, 0.03))
    assert sigmas(frames(0.7, config).missing()) == pytest.approx([0.01, 0.03])


def test_what_measurements_lack_is_found():
    sparse = frames(0.7, SparseConfig(memory=900))
    compare(sparse, 0.015, 0.02, 300)
    assert sigmas(sparse.missing()) == pytest.approx([0.015, 0.02], rel=0.1)
    factor = SparseConfig().step_factor
    assert sigmas(sparse.missing_of_step()) == pytest.approx(factor * sigmas(sparse.missing()))


def test_measurements_that_agree_as_they_claim_lack_nothing():
    sparse = frames(0.7)
    compare(sparse, 0.0, 0.0, 20)
    assert not sparse.doubtful and not sparse.missing().any()


def test_directions_that_are_open_tell_nothing():
    """Sliding along a wall, which is claimed, is no disagreement."""
    sparse = frames(0.7, SparseConfig(memory=900))
    claimed = CLAIMED.copy()
    claimed[3, 3] = 0.2**2
    compare(sparse, 0.015, 0.02, 300, claimed=claimed)
    assert sigmas(sparse.missing())[1] == pytest.approx(0.02, rel=0.15)


def test_only_the_latest_comparisons_count():
    sparse = frames(0.7, SparseConfig(memory=30))
    compare(sparse, 0.05, 0.05, 20)
    assert sparse.doubtful
    compare(sparse, 0.0, 0.0, 20, seed=1)
    assert not sparse.doubtful


def test_where_links_lack_much_depth_links_more_and_farther_keyframes():
    config, loops = SparseConfig(), LoopConfig()
    sparse = frames(0.7)
    compare(sparse, 0.015, 0.02, 30)
    reaching = sparse.reaching(loops)
    assert reaching.reach == config.link_reach and reaching.known == config.link_known
    assert len(reaching.ages) > len(loops.ages) and reaching.skip < loops.skip
    assert reaching.gate == loops.gate


def test_where_they_lack_nothing_links_stay_as_they_are():
    video, way_points = frames(1 / 30), frames(0.7)
    for sparse in (video, way_points):
        compare(sparse, 0.0, 0.0, 30)
        assert sparse.reaching(LoopConfig()) == LoopConfig()
