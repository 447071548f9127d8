"""Labelling a run again: what is looked at, and what is known from before."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from label_runs import CONFIG, DETECTOR, LOOKED_AT, Labelled, label, labelled, macro_f, mapped, small_sequence

from thingmap.detectors.spec import make_detector
from thingmap.mapper.evaluation.inputs.load_run import load_run
from thingmap.mapper.labelling.labelling_config import SourceConfig
from thingmap.mapper.map.object_map import ObjectMap
from thingmap.mapper.map.store import OutputFolder


@pytest.fixture
def run(tmp_path_factory) -> Path:
    """The folder of the run, not to be changed."""
    return mapped(tmp_path_factory.getbasetemp())


@pytest.fixture
def first(tmp_path_factory) -> Labelled:
    """The run labelled, not to be changed."""
    return labelled(tmp_path_factory.getbasetemp())


@pytest.fixture
def out(first, tmp_path) -> Path:
    """A labelled run that a test may change."""
    return shutil.copytree(first.out, tmp_path / "out")


def test_a_second_time_nothing_is_looked_at_and_the_files_are_the_same(out, first):
    def fail(frame):
        raise AssertionError("a frame was looked at")

    fail.classes = ObjectMap.load(out).classes
    before = {name: (out / name).read_bytes() for name in ("labels.ply", "voxels.npz", "map.json")}
    again = label(out, detector=fail)
    assert again.added == 0 and again.frames == LOOKED_AT and again.points == first.report.points
    assert {name: (out / name).read_bytes() for name in before} == before


def test_gathered_again_it_is_the_same(out):
    before = {name: (out / name).read_bytes() for name in ("labels.ply", "voxels.npz")}
    report = label(out, again=True)
    assert report.added == report.frames and {name: (out / name).read_bytes() for name in before} == before


def test_only_new_frames_are_looked_at(out, first):
    config = replace(CONFIG, stride=1)
    report = label(out, config)
    assert report.added == LOOKED_AT and report.frames == 2 * LOOKED_AT and not report.anew
    back = label(out)  # fewer than there are: what is in a voxel cannot be taken out
    assert back.anew and back.added == back.frames == LOOKED_AT


def test_ctrl_c_keeps_what_was_gathered(run, first, tmp_path):
    out = shutil.copytree(run, tmp_path / "out")
    asked = iter([False, False, False, True])
    report = label(out, should_stop=lambda: next(asked))
    assert report.stopped and report.added == report.frames == 3 and report.labels is None
    assert not (out / "labels.ply").exists()
    rest = label(out)
    assert rest.added == LOOKED_AT - 3 and not rest.anew
    assert macro_f(out) > macro_f(first.out) - 0.1  # voxels of two submaps


def test_a_failure_keeps_what_was_gathered(run, tmp_path):
    out = shutil.copytree(run, tmp_path / "out")
    detect, seen = make_detector(DETECTOR, small_sequence()), []

    def breaks(frame):
        seen.append(frame.name)
        if len(seen) == 3:
            raise RuntimeError("out of memory")
        return detect(frame)

    with pytest.raises(RuntimeError, match="memory"):
        label(out, detector=breaks)
    assert label(out).added == LOOKED_AT - 2


def shift_keyframes(out, metres: float) -> None:
    """Move every second keyframe, and not the frames that hang on it."""
    with np.load(out / "keyframes.npz") as content:
        arrays = dict(content)
    arrays["T_world_camera"][1::2, 0, 3] += metres
    np.savez(out / "keyframes.npz", **arrays)


@pytest.mark.parametrize(("metres", "anew"), [(0.001, False), (0.01, True)])
def test_frames_that_moved_against_their_keyframe_are_looked_at_again(out, first, metres, anew):
    shift_keyframes(out, metres)
    report = label(out)
    assert report.anew == anew and report.added == (LOOKED_AT if anew else 0)


def test_when_all_moves_the_points_go_along(out, first):
    before = load_run(out).cloud()[0]
    with np.load(out / "keyframes.npz") as content:
        arrays = dict(content)
    arrays["T_world_camera"][:, 0, 3] += 0.5  # whole voxels, so that the grid is the same
    np.savez(out / "keyframes.npz", **arrays)
    stamps, poses = OutputFolder.open(out).read_trajectory()
    poses[:, 0, 3] += 0.5
    OutputFolder.open(out).write_trajectory(stamps, poses)
    config = replace(CONFIG, sources=SourceConfig(volumes=0.0))
    report = label(out, config)
    assert report.added == 0
    after = load_run(out).cloud()[0]
    assert abs(len(after) - len(before)) < 0.01 * len(before)
    np.testing.assert_allclose(after.mean(axis=0) - before.mean(axis=0), [0.5, 0.0, 0.0], atol=2e-3)


def test_another_detector_starts_anew(out):
    report = label(out, spec="simulated?seed=2")
    assert report.anew and report.added == report.frames
