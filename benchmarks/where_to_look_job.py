"""One scene of the benchmark of viewpoints: a map of few views, and what every single further view makes of it.

All views that may be chosen are tried, so every way to choose is judged by the same maps, and a random choice by its
exact mean.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numba
import numpy as np
from suite import Scene
from suite_job import is_rendered, render, scene_folder
from where_to_look_answers import answer, bits_of, match_truth, right_answer

from thingmap.datasets.frame import BrokenFrame, Frame
from thingmap.datasets.open import open_sequence
from thingmap.datasets.open_truth import open_truth
from thingmap.datasets.truth import TrueObject
from thingmap.detectors.detections import Detections
from thingmap.detectors.spec import make_detector
from thingmap.mapper.config import MapperConfig, OdometryConfig, OdometrySource
from thingmap.mapper.config_file import dump_config
from thingmap.mapper.map.object_map import ObjectMap
from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.map.thing import Thing
from thingmap.mapper.mapper import SemanticMapper

DETECTOR = "simulated?seed={seed}&parts=1"
START = 5  # views of the first map: things need three to be landmarks
EVERY = 3  # of the other frames, those that may be chosen
THINGS = 3  # asked about in a scene, those least sure
LABELS = 1  # the same of labels
ENOUGH_BITS = 0.05  # of which a thing, or all things together, must leave as much to learn
SAME_PLACE = 0.1  # metres: a thing that got another id, by a merger
CONFIG = replace(MapperConfig(), odometry=OdometryConfig(source=OdometrySource.POSES))


@dataclass(frozen=True, slots=True)
class Job:
    """A scene, and the folder in which it is, or is rendered."""

    scene: Scene
    folder: Path


@dataclass(frozen=True, slots=True)
class Tried:
    """One question of one scene, and the C views that may be chosen to answer it.

    Attributes:
        scene: its name.
        about_thing: whether it is about one thing; else about a label.
        gain: of every view, bits, as `ObjectMap.where_to_look` expects it.
        distance: of every view from the last one of the map, metres.
        bits, brier: what the map of few views leaves unknown, and by how much it is wrong.
        bits_after, brier_after: the same with each of the views added.
    """

    scene: str
    about_thing: bool
    gain: tuple[float, ...]
    distance: tuple[float, ...]
    bits: float
    brier: float
    bits_after: tuple[float, ...]
    brier_after: tuple[float, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Question:
    """What is asked, and the things whose answers are judged; `label` is None for "is it, and what is it?"."""

    what: str
    label: str | None
    things: tuple[Thing, ...]
    truth: tuple[str | None, ...]


def run(job: Job) -> list[Tried]:
    """Every question of a scene; the scene is rendered if it is not there.

    Raises:
        UserError: the scene in the folder is not what it should be, or the folder cannot be written.
    """
    numba.set_num_threads(1)
    if not is_rendered(job.scene, job.folder):
        render(job.scene, job.folder)
    place = scene_folder(job.scene, job.folder)
    sequence, objects = open_sequence(place), open_truth(place).located
    detector = make_detector(DETECTOR.format(seed=job.scene.seed), sequence)
    numbers = [*range(START), *range(START + EVERY, len(sequence), EVERY)]
    frames = [sequence[number] for number in numbers]
    views = [(frame, detector(frame)) for frame in frames]
    start, more = views[:START], views[START:]
    with tempfile.TemporaryDirectory() as folder:
        first = _first_map(start, Path(folder) / "out")
        questions = _questions(first, objects)
        poses = np.array([frame.T_world_camera for frame, _ in more])
        gains = [_gains(first, question, poses) for question in questions]
    maps = [_feed([*start, view]).object_map(include_doubtful=True) for view in more]
    away = np.linalg.norm(poses[:, :3, 3] - frames[START - 1].T_world_camera[:3, 3], axis=1)
    return [
        _tried(job.scene, question, gain, away, [first, *maps]) for question, gain in zip(questions, gains, strict=True)
    ]


def _feed(views: Sequence[tuple[Frame, Detections]]) -> SemanticMapper:
    mapper = SemanticMapper(config=CONFIG)
    for frame, found in views:
        try:
            mapper.process_frame(frame, found)
        except BrokenFrame:  # left out, as `thingmap run` does
            continue
    return mapper


def _first_map(start: Sequence[tuple[Frame, Detections]], folder: Path) -> ObjectMap:
    """As a run leaves it: with its cloud, its trajectory and what every view said."""
    out, mapper = OutputFolder.create(folder), _feed(start)
    out.write_config(dump_config(CONFIG))
    out.write_trajectory(*mapper.trajectory())
    out.write_cloud(*mapper.cloud())
    out.write_map(mapper.object_map(include_doubtful=True), include_doubtful=True)
    return ObjectMap.load(folder)


def _questions(first: ObjectMap, objects: Sequence[TrueObject]) -> list[Question]:
    truth = dict(zip((thing.id for thing in first.things), match_truth(first.things, objects), strict=True))
    unsure = sorted(first.things, key=lambda thing: (-bits_of(answer(thing, None, first.classes)), thing.id))
    things = [t for t in unsure[:THINGS] if bits_of(answer(t, None, first.classes)) >= ENOUGH_BITS]
    open_bits = {label: sum(bits_of(answer(t, label, ())) for t in first.things) for label in first.classes}
    labels = sorted((label for label in open_bits if open_bits[label] >= ENOUGH_BITS), key=lambda k: -open_bits[k])
    everything = tuple(truth[t.id] for t in first.things)
    return [
        *(Question(thing.id, None, (thing,), (truth[thing.id],)) for thing in things),
        *(Question(label, label, first.things, everything) for label in labels[:LABELS]),
    ]


def _gains(first: ObjectMap, question: Question, poses: np.ndarray) -> tuple[float, ...]:
    answers = [first.where_to_look(question.what, 1, candidates=pose[None]) for pose in poses]
    return tuple(found[0].gain_bits if found else 0.0 for found in answers)


def _tried(scene: Scene, question: Question, gain: tuple[float, ...], away: np.ndarray, maps: list[ObjectMap]) -> Tried:
    """The first map and those with a view more, judged by the question."""
    judged = []
    for object_map in maps:
        classes, bits, brier = object_map.classes, 0.0, 0.0
        for thing, true in zip(question.things, question.truth, strict=True):
            p = answer(_same(object_map, thing), question.label, classes)
            bits += bits_of(p)
            brier += float(np.sum((p - right_answer(true, question.label, classes)) ** 2))
        judged.append((bits, brier))
    (bits, brier), *after = judged
    return Tried(
        scene=scene.name,
        about_thing=question.label is None,
        gain=gain,
        distance=tuple(away.tolist()),
        bits=bits,
        brier=brier,
        bits_after=tuple(b for b, _ in after),
        brier_after=tuple(b for _, b in after),
    )


def _same(object_map: ObjectMap, thing: Thing) -> Thing | None:
    """The thing of that id, else the nearest one at its place."""
    by_id = next((other for other in object_map.things if other.id == thing.id), None)
    near = [(float(np.linalg.norm(other.position - thing.position)), other.id, other) for other in object_map.things]
    nearest = min(near, default=None, key=lambda item: item[:2])
    return by_id or (nearest[2] if nearest and nearest[0] <= SAME_PLACE else None)
