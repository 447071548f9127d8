import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from labelling_problems import SEEDS
from voxel_frames import NAMES, PointFrame, assert_same, gathered, pose, random_frame, reference

from thingmap.datasets.errors import UserError
from thingmap.mapper.labelling.voxel_config import VoxelConfig
from thingmap.mapper.labelling.voxels import VoxelEvidence

HERE = np.eye(4)[None]


def one_frame(points: np.ndarray, p: np.ndarray, keyframe: int = 0) -> PointFrame:
    normals = np.tile(np.float32([0.0, 0.0, -1.0]), (len(points), 1))
    colours = np.arange(3 * len(points), dtype=np.uint8).reshape(-1, 3)
    return PointFrame(keyframe, np.eye(4), np.float32(points), normals, colours, np.log(np.float32(p)))


def test_the_probability_of_a_voxel_is_the_geometric_mean_of_its_points() -> None:
    points = [[0.001, 0.002, 1.001], [0.003, 0.002, 1.003], [0.011, 0.0, 1.001]]
    frame = one_frame(np.array(points), np.array([[0.2, 0.9], [0.8, 0.1], [0.5, 0.5]]))
    voxels = gathered([frame], VoxelConfig(), 1).assemble(HERE)
    assert voxels.size == 0.01 and voxels.cells.tolist() == [[0, 0, 100], [1, 0, 100]]
    np.testing.assert_allclose(np.exp(voxels.log_p), [[0.4, 0.3], [0.5, 0.5]], rtol=1e-5)
    np.testing.assert_allclose(voxels.points[0], [0.002, 0.002, 1.002], atol=1e-6)
    np.testing.assert_allclose(voxels.colours[0], [1.5, 2.5, 3.5])
    assert voxels.count.tolist() == [2, 1] and voxels.views.tolist() == [1, 1]
    assert voxels.log_p_error is None


@settings(max_examples=40, deadline=None)
@given(seed=SEEDS, frames=st.integers(1, 6), points=st.integers(0, 60), classes=st.integers(1, 8))
def test_voxels_are_those_of_a_dictionary(seed: int, frames: int, points: int, classes: int) -> None:
    rng = np.random.default_rng(seed)
    held = [random_frame(rng, classes, points) for _ in range(frames)]
    voxels = gathered(held, VoxelConfig(), classes).assemble(HERE)
    expected = reference(held, 0.01)
    assert [tuple(cell) for cell in voxels.cells.tolist()] == sorted(expected)
    for n, cell in enumerate(sorted(expected)):
        one = expected[cell]
        np.testing.assert_allclose(voxels.points[n], one["points"], atol=1e-7)
        np.testing.assert_allclose(voxels.colours[n], one["colours"], rtol=1e-5)
        np.testing.assert_allclose(voxels.log_p[n], one["log_p"], rtol=1e-5, atol=1e-6)
        assert (voxels.count[n], voxels.views[n]) == (one["count"], one["views"])
        length = np.linalg.norm(one["normal_sum"])
        if length == 0.0:
            assert np.isnan(voxels.normals[n]).all()
        elif length > 0.1:
            np.testing.assert_allclose(voxels.normals[n], one["normal_sum"] / length, atol=1e-5)


@settings(max_examples=20, deadline=None)
@given(seed=SEEDS)
def test_the_order_of_frames_and_of_points_does_not_matter(seed: int) -> None:
    rng = np.random.default_rng(seed)
    frames = [random_frame(rng, 3, 50) for _ in range(4)]
    mixed = []
    for i in rng.permutation(4):
        f, order = frames[i], rng.permutation(50)
        arrays = f.points[order], f.normals[order], f.colours[order], f.log_p[order]
        mixed.append(PointFrame(f.keyframe, f.T_keyframe_camera, *arrays))
    voxels, other = (gathered(list(some), VoxelConfig(), 3).assemble(HERE) for some in (frames, mixed))
    np.testing.assert_array_equal(voxels.cells, other.cells)
    np.testing.assert_array_equal(voxels.views, other.views)
    np.testing.assert_allclose(voxels.log_p, other.log_p, atol=1e-5)
    np.testing.assert_allclose(voxels.points, other.points, atol=1e-7)


def test_the_same_frames_give_the_same_bits() -> None:
    frames = [random_frame(np.random.default_rng(i), 3, 400, i // 2) for i in range(6)]
    T = np.stack([pose(np.random.default_rng(9)) for _ in range(3)])
    assert_same(*(gathered(frames, VoxelConfig(), 3, T).assemble(T) for _ in range(2)))


def test_voxels_move_with_their_keyframe() -> None:
    rng = np.random.default_rng(3)
    evidence = gathered([random_frame(rng, 2, 200)], VoxelConfig(), 2)
    T = pose(rng, 2.0)
    voxels, moved = evidence.assemble(HERE), evidence.assemble(T[None])
    assert moved.count.sum() == voxels.count.sum() == 200
    np.testing.assert_array_equal(moved.cells, np.floor(moved.points / 0.01))
    centre, moved_centre = (v.count @ v.points / 200 for v in (voxels, moved))
    np.testing.assert_allclose(moved_centre, T[:3, :3] @ centre + T[:3, 3], atol=1e-6)
    alone = moved.count == 1  # of single points, normals turn as they are
    known = voxels.normals[voxels.count == 1]
    turned = {tuple(np.round(n, 4)) for n in (known[~np.isnan(known[:, 0])] @ T[:3, :3].T).tolist()}
    found = moved.normals[alone & ~np.isnan(moved.normals[:, 0])]
    assert len(found) and {tuple(np.round(n, 4)) for n in found.tolist()} <= turned


def test_only_the_submap_whose_anchor_moves_goes_with_it() -> None:
    frames = [random_frame(np.random.default_rng(k), 2, 100, keyframe=k) for k in (0, 1)]
    evidence = gathered(frames, VoxelConfig(), 2)  # without poses each keyframe has its own
    assert evidence.submaps == (2, 0)
    T = np.stack([np.eye(4), np.eye(4)])
    before = evidence.assemble(T)
    T[1, 0, 3] = 5.0
    after = evidence.assemble(T)
    stayed = after.cells[:, 0] < 250
    assert after.count[stayed].sum() == after.count[~stayed].sum() == 100
    assert before.count.sum() == 200 and before.cells[:, 0].max() < 250


def test_overlapping_submaps_are_one_in_the_world() -> None:
    """Keyframes whole voxels apart: the grids of both submaps fall onto each other."""
    rng = np.random.default_rng(5)
    frames = [random_frame(rng, 3, 300) for _ in range(2)]
    together = gathered(frames, VoxelConfig(), 3).assemble(HERE)
    T = np.stack([np.eye(4), np.eye(4)])
    T[1, :3, 3] = 0.32, -0.08, 0.16
    f = frames[1]
    other = PointFrame(1, np.linalg.inv(T[1]) @ f.T_keyframe_camera, *f.arguments()[2:])
    evidence = gathered([frames[0], other], VoxelConfig(submap_keyframes=1), 3, T)
    assert evidence.submaps == (2, 0)
    apart = evidence.assemble(T)
    np.testing.assert_array_equal(apart.views, together.views)
    assert apart.views.max() == 2
    np.testing.assert_array_equal(apart.count, together.count)
    np.testing.assert_allclose(apart.log_p, together.log_p, atol=1e-5)
    np.testing.assert_allclose(apart.points, together.points, atol=1e-6)


def test_a_frame_counts_once_where_its_voxels_fall_into_one_cell() -> None:
    """Turned by 45 degrees, points of neighbouring voxels share cells."""
    frames = [random_frame(np.random.default_rng(i), 1, 500) for i in range(3)]
    T = np.eye(4)
    T[:2, :2] = np.sqrt(0.5) * np.array([[1.0, -1.0], [1.0, 1.0]])
    evidence = gathered(frames, VoxelConfig(), 1)
    turned = evidence.assemble(T[None])
    assert len(turned) < len(evidence.assemble(HERE))
    assert turned.views.max() <= 3


@pytest.mark.parametrize(
    ("config", "submaps"),
    [
        (VoxelConfig(), 1),
        (VoxelConfig(submap_keyframes=2), 3),  # keyframes 0-1, 2-3, 4-5
        (VoxelConfig(submap_radius=0.25), 2),  # 0-2, 3-5 at 0.1 m each
        (VoxelConfig(submap_voxels=1), 6),
    ],
)
def test_when_a_submap_ends(config: VoxelConfig, submaps: int) -> None:
    T = np.tile(np.eye(4), (6, 1, 1))
    T[:, 0, 3] = 0.1 * np.arange(6)
    point = one_frame(np.array([[0.0, 0.0, 1.0]]), np.array([[0.5, 0.5]]))
    frames = [PointFrame(k, np.eye(4), *point.arguments()[2:]) for k in range(6)]
    evidence = gathered(frames, config, 1, T)
    assert evidence.submaps[0] == submaps
    voxels = evidence.assemble(T)
    np.testing.assert_allclose(np.sort(voxels.points[:, 0]), T[:, 0, 3], atol=1e-7)


def test_warp_is_how_far_a_submap_is_bent() -> None:
    T = np.tile(np.eye(4), (3, 1, 1))
    T[1, 0, 3], T[2, 0, 3] = 0.1, 0.2
    frames = [random_frame(np.random.default_rng(k), 1, 10, keyframe=k) for k in range(3)]
    evidence = gathered(frames, VoxelConfig(submap_keyframes=2), 1, T)  # 0-1 and 2
    assert evidence.warp(T) == pytest.approx((0.0, 0.0), abs=1e-7)
    T[2, 1, 3] += 3.0  # another submap
    assert evidence.warp(T) == pytest.approx((0.0, 0.0), abs=1e-7)
    T[1, 1, 3] += 0.03
    assert evidence.warp(T) == pytest.approx((0.03, 0.0), abs=1e-6)


def test_without_points_there_are_no_voxels() -> None:
    empty = VoxelEvidence(NAMES[:3], VoxelConfig())
    for evidence in (empty, gathered([random_frame(np.random.default_rng(0), 3, 0)], VoxelConfig(), 3)):
        voxels = evidence.assemble(HERE)
        assert len(voxels) == 0 and voxels.log_p.shape == (0, 4) and voxels.normals.shape == (0, 3)


def test_mistakes_are_named() -> None:
    frame = random_frame(np.random.default_rng(0), 2, 5)
    with pytest.raises(ValueError, match="shapes"):
        VoxelEvidence(NAMES[:3], VoxelConfig()).add(*frame.arguments())
    frame.log_p[0, 0] = -np.inf
    with pytest.raises(ValueError, match="finite"):
        VoxelEvidence(NAMES[:2], VoxelConfig()).add(*frame.arguments())
    frame.log_p[0, 0] = -1.0
    evidence = gathered([PointFrame(4, *frame.arguments()[1:])], VoxelConfig(), 2)
    with pytest.raises(ValueError, match="keyframe 4 has no pose"):
        evidence.assemble(HERE)
    with pytest.raises(ValueError, match="of the origin"):
        T = np.tile(np.eye(4), (5, 1, 1))
        T[4, 0, 3] = 2e5
        evidence.assemble(T)
    with pytest.raises(UserError, match="voxel_size"):
        VoxelConfig(voxel_size=0.0)
