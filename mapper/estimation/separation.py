"""Two things that went into one landmark become two again: see `mix_ups.py` for how they are told.

All that was said of the second thing leaves the landmark, and becomes a landmark of its own, which joins the one that
is there already, if any (`Lifecycle.reunite`). Nothing is lost: should the loop closure turn out to be wrong, poses go
back, both lie at one place again, and are united in the same way. Only clusters that are too small for a thing leave
the graph for good.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from ...detectors.detections import Part
from ...factors.score_model import ScoreModel
from ..config import LifecycleConfig
from .beliefs import Belief
from .landmarks import Landmark
from .mix_ups import LEAST_KEYFRAMES, MixUp, find_mix_ups, in_world
from .pose_graph import PoseGraph, solve_poses
from .records import Box, DepthCentre, Look, Scores
from .scene import Scene
from .smoother import Smoother

Measurement = DepthCentre | Box | Look | Scores


class Registry(Protocol):
    """What makes landmarks: the lifecycle."""

    def new_belief(self) -> Belief:
        """Of something of which nothing is known."""
        ...

    def add_landmark(
        self,
        position: np.ndarray,
        log_size: np.ndarray,
        covariance: np.ndarray,
        belief: Belief,
        stamps: tuple[float, float],
    ) -> Landmark:
        """A new landmark without measurements."""
        ...


@dataclass(frozen=True, slots=True)
class Separated:
    """How many landmarks were more than one thing, and how many new ones that made."""

    mixed: int
    made: int


def separate(
    scene: Scene, smoother: Smoother, registry: Registry, scores: ScoreModel, config: LifecycleConfig
) -> Separated:
    """Parts what only wrong poses held together, and solves the graph from where the camera says that it was.

    Args:
        scene, smoother: of the map, solved.
        registry: makes the new landmarks.
        scores: what detector scores say.
        config: how far measurements of one thing differ.
    """
    poses = solve_poses(PoseGraph.of(smoother.ledger), smoother.poses())
    mixed, made = find_mix_ups(scene.landmarks.values(), smoother, poses, config), 0
    for mix_up in mixed:
        for part in range(1, len(mix_up.keyframes)):
            landmark = scene.landmarks[mix_up.landmark]
            made += _part(landmark, mix_up, part, smoother, registry, scores, poses)
    if mixed:
        smoother.solve_from(poses)
    return Separated(len(mixed), made)


def _part(
    landmark: Landmark,
    mix_up: MixUp,
    part: int,
    smoother: Smoother,
    registry: Registry,
    scores: ScoreModel,
    poses: np.ndarray,
) -> bool:
    """Takes one part out of a landmark; whether it became another."""
    measured = mix_up.keyframes[part]
    supporting = mix_up.seen_in(landmark.supporting, part)
    records = _take_out(landmark.number, supporting | measured, smoother)
    log, embedding = landmark.log.take_out(supporting), landmark.embedding.take_out(supporting)
    landmark.supporting = landmark.supporting - supporting
    landmark.measurements -= len(measured)
    landmark.belief.forget(supporting)
    if len(measured) < LEAST_KEYFRAMES:
        return False  # outliers
    position, log_size = _volume(records, smoother, poses, landmark.log_size)
    stamps = [note.stamp for note in log] or [landmark.first_seen, landmark.last_seen]
    belief = _belief(registry.new_belief(), records, scores, poses[:, :3, 3] - position)
    made = registry.add_landmark(position, log_size, landmark.covariance, belief, (min(stamps), max(stamps)))
    made.supporting, made.log, made.measurements, made.embedding = supporting, log, len(measured), embedding
    for record in records:
        smoother.add(replace(record, landmark=made.number))
    return True


def _take_out(landmark: int, keyframes: set[int], smoother: Smoother) -> list[Measurement]:
    """Drops all that these keyframes said about a landmark, and returns it."""
    numbers = [
        number
        for number, record in enumerate(smoother.ledger)
        if isinstance(record, Measurement)
        and record.keyframe in keyframes
        and smoother.owner(record.landmark) == landmark
        and not smoother.is_dropped(number)
    ]
    records = [smoother.ledger[number] for number in numbers]
    smoother.drop_measurements(numbers)
    return [record for record in records if isinstance(record, Measurement)]


def _volume(
    records: list[Measurement], smoother: Smoother, poses: np.ndarray, log_size: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(3,) position, world, metres, and (3,) log half-axes by depth centres and whole boxes; else `log_size`."""
    centres = [record for record in records if isinstance(record, DepthCentre)]
    position = np.median(in_world(centres, poses)[0], axis=0)
    ranges, k = {record.keyframe: record.centre[2] for record in centres}, smoother.intrinsics
    boxes = [r for r in records if isinstance(r, Box) and r.part == Part.WHOLE and r.keyframe in ranges]
    if not boxes:
        return position, log_size
    sides = np.array([ranges[box.keyframe] * (box.xyxy[2:] - box.xyxy[:2]) for box in boxes])
    wide, high = np.median(np.log(sides / (2.0 * np.array([k.fx, k.fy]))), axis=0)
    return position, np.array([wide, wide, high])


def _belief(belief: Belief, records: list[Measurement], scores: ScoreModel, to_cameras: np.ndarray) -> Belief:
    """What looks and scores say of a thing, (M, 3) metres off the cameras of all keyframes."""
    looks = {record.keyframe: record for record in records if isinstance(record, Look)}
    found: dict[int, Scores] = {}
    for record in records:
        if isinstance(record, Scores):
            found.setdefault(record.keyframe, record)  # the detection that weighs most comes first
    for t in sorted(looks.keys() | found.keys()):
        look, seen = looks.get(t), found.get(t)
        read = None if seen is None else scores.evidence(seen.scores, seen.occlusion, seen.part)
        if look is None:  # of its time as a candidate only detections are known
            belief.look(to_cameras[t], hits=1.0, scores=read, keyframe=t)
        else:
            belief.look(to_cameras[t], look.hits, look.misses, look.free, look.depth, look.seen, read, t)
    belief.update()
    return belief
