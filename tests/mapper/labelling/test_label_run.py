"""The whole job on a small synthetic run: files, terms, mistakes."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from label_runs import CONFIG, LOOKED_AT, Labelled, label, labelled, macro_f, mapped, small_sequence
from plyfile import PlyData

from thingmap.datasets.errors import InputError, UserError
from thingmap.datasets.frame import BrokenFrame, FrameProblem
from thingmap.datasets.lidar import NO_CAMERA
from thingmap.datasets.open import open_sequence
from thingmap.detectors.detections import Detections
from thingmap.mapper.export.colors import class_color
from thingmap.mapper.labelling.instances import Instances, ThingPoints
from thingmap.mapper.labelling.labelling_config import SourceConfig
from thingmap.mapper.labelling.mrf_config import MrfConfig, Smoothness
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


def test_points_are_labelled_and_counted(first):
    out, report = first
    assert report.added == report.frames == LOOKED_AT and not report.anew and not report.stopped
    content = PlyData.read(str(out / "labels.ply"))
    vertices = content["vertex"].data
    names = ObjectMap.load(out).classes
    kinds = [line for line in content.comments if line.startswith("label")]
    assert kinds == [f"label {k} {json.dumps(name)}" for k, name in enumerate(names, start=1)]
    assert len(vertices) == report.voxels == sum(report.points.values())
    for k, name in enumerate(names, start=1):
        own = vertices[vertices["label"] == k]
        assert len(own) == report.points.get(name, 0)
        assert set(zip(own["red"], own["green"], own["blue"], strict=True)) <= {tuple(class_color(name))}
    document = json.loads((out / "map.json").read_text())
    assert document["labels"] == {"file": "labels.ply", "points": report.points}


def test_the_map_is_otherwise_as_it_was(first, run):
    before, after = (json.loads((folder / "map.json").read_text()) for folder in (run, first.out))
    del after["labels"]
    for thing in after["things"]:
        del thing["points"]
        thing |= thing.pop("volume", {})  # what it was where points have changed it
    assert after == before
    ObjectMap.load(first.out).things[0].explain()  # the evidence file still fits


def test_most_points_of_objects_are_labelled_right(first, run):
    # better than the boxes of the map's things, which the evaluator takes where there are no labels
    assert macro_f(first.out) > max(0.8, macro_f(run))


@pytest.mark.parametrize("fast", [False, True])
@pytest.mark.parametrize("smoothness", list(Smoothness))
def test_every_term_labels_from_the_same_voxels(out, smoothness, fast):
    config = replace(CONFIG, mrf=MrfConfig(smoothness=smoothness, fast=fast))
    report = label(out, config)
    assert report.added == 0 and len(report.points) > 3 and report.points["background"] > 0.8 * report.voxels
    assert (report.labels.pairs > report.voxels) == (smoothness is not Smoothness.NONE)


def test_things_volumes_can_be_left_out(out, first):
    config = replace(CONFIG, sources=SourceConfig(volumes=0.0))
    report = label(out, config)
    assert report.added == 0 and report.points != first.report.points


def test_instances_are_written_where_somebody_finds_them(out):
    def find(voxels, labels, object_map, config):
        number = np.where(labels.label >= 0, len(object_map.things), 0)
        counts = [int(np.sum(number == t)) for t in range(1, len(object_map.things) + 1)]
        things = [ThingPoints(thing.id, n, None) for thing, n in zip(object_map.things, counts, strict=True)]
        return Instances(number, tuple(things), ())

    report = label(out, find_instances=find)
    object_map = ObjectMap.load(out)
    content = PlyData.read(str(out / "labels.ply"))
    last = len(object_map.things)
    assert f"instance {last} {json.dumps(object_map.things[-1].id)}" in content.comments
    assert set(content["vertex"]["instance"].tolist()) == {0, last}
    things = json.loads((out / "map.json").read_text())["things"]
    assert [thing["points"] for thing in things] == [0] * (last - 1) + [report.voxels - report.points["background"]]
    label(out, find_instances=None)
    assert "instance" not in (PlyData.read(str(out / "labels.ply"))["vertex"].data.dtype.names or ())
    assert all("points" not in thing for thing in json.loads((out / "map.json").read_text())["things"])


def test_frames_that_cannot_be_read_are_named(out):
    (out / "voxels.npz").unlink()
    report = label(out, sequence=Unreadable(small_sequence(), {2, 4}))
    assert [len(names) for names in report.skipped.values()] == [2] and report.frames == LOOKED_AT - 2


class Unreadable:
    """A sequence some of whose frames are broken."""

    def __init__(self, sequence, broken) -> None:
        self._sequence, self._broken = sequence, broken

    def __getattr__(self, name):
        return getattr(self._sequence, name)

    def __len__(self) -> int:
        return len(self._sequence)

    def __getitem__(self, index):
        if index in self._broken:
            raise BrokenFrame(f"frame {index}", FrameProblem.UNREADABLE)
        return self._sequence[index]


def test_mistakes_are_told(out):
    other = open_sequence("synth:tabletop?seed=4&frames=3&width=160&clutter=low")
    with pytest.raises(UserError, match=r"not in synth.*--sequence"):
        label(out, sequence=other)
    with pytest.raises(UserError, match="finds sofa, but the map's classes are"):
        label(out, detector=lambda frame: Detections.empty(("sofa",)), again=True)
    for name, text in (("voxels.npz", "no archive"), ("keyframes.npz", "no archive")):
        (out / name).write_text(text)
        with pytest.raises(InputError, match=name):
            label(out)
    with pytest.raises(InputError, match="thingmap run"):
        OutputFolder.open(out / "nowhere")


def test_a_lidar_is_refused(out):
    class Blind(Unreadable):
        @property
        def intrinsics(self):
            return NO_CAMERA

    with pytest.raises(UserError, match="LiDAR"):
        label(out, sequence=Blind(small_sequence(), set()))
