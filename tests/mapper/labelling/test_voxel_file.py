from pathlib import Path

import numpy as np
import pytest
from voxel_frames import NAMES, assert_same, gathered, pose, random_frame

from thingmap.datasets.errors import InputError, UserError
from thingmap.mapper.labelling.voxel_config import VoxelConfig
from thingmap.mapper.labelling.voxels import VoxelEvidence

POSES = np.stack([pose(np.random.default_rng(100 + k)) for k in range(6)])


def frames(classes: int) -> list:
    rng = np.random.default_rng(classes)
    return [random_frame(rng, classes, 500, keyframe=k, speaking=5) for k in range(6)]


@pytest.mark.parametrize("classes", [6, 40])
def test_saved_and_spilled_voxels_are_the_same(classes: int, tmp_path: Path) -> None:
    resident = gathered(frames(classes), VoxelConfig(submap_keyframes=2), classes, POSES)
    spilled = gathered(frames(classes), VoxelConfig(submap_keyframes=2, memory=0), classes, POSES)
    assert resident.submaps == (3, 0) and spilled.submaps == (3, 2)
    expected = resident.assemble(POSES)
    assert_same(spilled.assemble(POSES), expected)
    for evidence in (resident, spilled):
        evidence.save(tmp_path / "voxels.npz")
        loaded = VoxelEvidence.load(tmp_path / "voxels.npz")
        assert (loaded.classes, loaded.config, loaded.frames) == (NAMES[:classes], evidence.config, 6)
        assert loaded.warp(POSES) == pytest.approx((0.0, 0.0), abs=1e-6)
        assert_same(loaded.assemble(POSES), expected)


def test_what_was_loaded_can_be_gone_on_from(tmp_path: Path) -> None:
    config = VoxelConfig(submap_keyframes=3)
    gathered(frames(3)[:3], config, 3, POSES).save(tmp_path / "voxels.npz")
    loaded = VoxelEvidence.load(tmp_path / "voxels.npz")
    for frame in frames(3)[3:]:
        loaded.add(*frame.arguments(), POSES)
    assert_same(loaded.assemble(POSES), gathered(frames(3), config, 3, POSES).assemble(POSES))


@pytest.mark.parametrize("classes", [6, 40])
@pytest.mark.parametrize("memory", [0, 60_000, 10_000_000])
def test_memory_stays_below_its_bound(classes: int, memory: int) -> None:
    evidence = VoxelEvidence(NAMES[:classes], VoxelConfig(submap_voxels=800, memory=memory))
    most = 0
    for number in range(30):
        frame = random_frame(np.random.default_rng(number), classes, 500, keyframe=number)
        evidence.add(*frame.arguments())
        most = max(most, evidence.nbytes)
    assert most <= evidence.memory_bound(500)
    submaps, spilled = evidence.submaps
    assert submaps == 30 and (spilled == 0) == (memory == 10_000_000)


@pytest.mark.parametrize(("classes", "a_row", "a_voxel"), [(6, 104, 84), (40, 172, 73)])
def test_bytes_of_a_voxel_are_those_that_are_stated(classes: int, a_row: int, a_voxel: int) -> None:
    evidence = gathered([random_frame(np.random.default_rng(0), classes, 1000, speaking=2)], VoxelConfig(), classes)
    rows = evidence.config.submap_voxels + 1000
    assert 0.8 * rows * a_row < evidence.nbytes <= rows * a_row
    voxels = len(evidence.assemble(np.eye(4)[None]))
    evidence.add(*random_frame(np.random.default_rng(1), classes, 0, keyframe=1).arguments())
    kept = 0 if classes == 6 else 6 * int(np.sum([submap.kept.taken.sum() for submap in evidence._store]))
    assert evidence.submaps == (2, 0)
    assert abs(evidence._store.nbytes - kept - voxels * a_voxel) < 150  # and a keyframe


def test_files_that_are_spilled_go_with_the_evidence(tmp_path: Path) -> None:
    config = VoxelConfig(memory=0)
    evidence = VoxelEvidence(NAMES[:2], config, spill_folder=tmp_path)
    for k in range(3):
        evidence.add(*random_frame(np.random.default_rng(k), 2, 10, keyframe=k).arguments())
    assert len(list(tmp_path.rglob("*.npz"))) == 2
    next(tmp_path.rglob("*.npz")).unlink()
    with pytest.raises(InputError):
        evidence.assemble(POSES)
    del evidence
    assert not list(tmp_path.iterdir())


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    evidence = VoxelEvidence(NAMES[:2], VoxelConfig(memory=0), spill_folder=tmp_path / "absent")
    evidence.add(*random_frame(np.random.default_rng(0), 2, 10).arguments())
    with pytest.raises(UserError, match="absent"):
        evidence.add(*random_frame(np.random.default_rng(1), 2, 10, keyframe=1).arguments())


def test_files_that_are_something_else_are_named(tmp_path: Path) -> None:
    path = tmp_path / "voxels.npz"
    with pytest.raises(InputError):
        VoxelEvidence.load(path)
    path.write_bytes(b"PK\x03\x04 and no more")
    with pytest.raises(InputError):
        VoxelEvidence.load(path)
    np.savez(path, other=np.arange(3))
    with pytest.raises(InputError, match="voxels"):
        VoxelEvidence.load(path)


@pytest.mark.parametrize(
    ("name", "array"),
    [
        ("ids", np.full(3, 40, np.int16)),
        ("cells", np.zeros((3, 3), np.int32)),
        ("counts", np.zeros((3, 2), np.float64)),
    ],
)
def test_damaged_arrays_are_not_gone_through(name: str, array: np.ndarray, tmp_path: Path) -> None:
    path = tmp_path / "voxels.npz"
    gathered(frames(40)[:1], VoxelConfig(), 40).save(path)
    content = dict(np.load(path))
    old = content[f"voxels_0_{name}"]
    content[f"voxels_0_{name}"] = np.resize(array, old.shape) if name == "ids" else array
    np.savez(path, **content)
    with pytest.raises(InputError):
        VoxelEvidence.load(path)
