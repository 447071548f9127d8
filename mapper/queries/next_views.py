"""The viewpoints that tell most, chosen one after the other.

A gain with nothing in the way is at least the gain with what hides, and a look tells at most as much after other looks
as before them. So both are bounds: the candidate with the largest bound is measured, and chosen once no other's bound
exceeds its gain (Minoux's lazy greedy search). Most candidates are never rendered.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...datasets.frame import Intrinsics
from ...factors.evidence_model import EvidenceModel
from ..map.thing import Thing
from .answer import PROBABLE
from .depth_image import empty_depth, smaller
from .information_gain import Questions, make_questions
from .map_content import MapContent
from .past_views import PastViews, past_views
from .run_files import RunFiles, class_posteriors
from .seen_volumes import Occluders, Volumes, box_sides
from .viewpoints import Viewpoint, free_places, ring_poses, visited_poses

LEAST_BITS = 1e-3  # a gain below it is none; nor is a thing looked for whose answer is as sure as that
LEAST_SHARE = 0.01  # of a viewpoint's gain: a thing that it tells less of is not named
RINGS = 8  # things with rings of their own, those least sure
WIDTH_PX = 160  # of the depth images in which candidates are judged


def next_views(
    content: MapContent,
    subject: Thing | None,
    labels: Sequence[str] | None,
    count: int,
    camera: Intrinsics,
    candidates: np.ndarray | None,
) -> list[Viewpoint]:
    """See `SightQuestions.where_to_look`; either a thing or labels are given."""
    files = RunFiles(content)
    trajectory, model = files.trajectory(), files.model()
    asked = _ask(content, files, model, subject, labels, trajectory)
    if not asked.things:
        return []
    R = content.R_world_upright
    everything = Volumes.of(content.things, R)
    occluders = Occluders(content.things, everything, R, files.cloud(), files.spacing)
    if candidates is None:
        known = visited_poses(trajectory[1])
        least_sure = np.argsort(-asked.questions.bits, kind="stable")[:RINGS]
        rings = ring_poses([asked.things[i] for i in least_sure], trajectory[1], R, camera)
        likely = [thing for thing in content.things if thing.existence >= PROBABLE]
        rings = rings[free_places(rings[:, :3, 3], likely, files.coarse_cloud(), R)]
        poses, visited = np.concatenate([known, rings]), np.arange(len(known) + len(rings)) < len(known)
    else:
        poses, visited = candidates, np.zeros(len(candidates), dtype=bool)
    search = _Search(asked, Volumes.of(asked.things, R), model, occluders, camera, poses)
    return [search.viewpoint(number, gains, bool(visited[number])) for number, gains in search.best(count)]


@dataclass(frozen=True, slots=True, eq=False)
class _Asked:
    """The things of which there is something to learn, (N, K) what they are, what is asked of them, and what was seen
    of them."""

    things: list[Thing]
    posterior: np.ndarray
    questions: Questions
    past: list[PastViews]


def _ask(
    content: MapContent,
    files: RunFiles,
    model: EvidenceModel,
    subject: Thing | None,
    labels: Sequence[str] | None,
    trajectory: tuple[np.ndarray, np.ndarray],
) -> _Asked:
    numbers = None if labels is None else [k for k, name in enumerate(content.classes) if name in labels]
    existence = np.array([thing.existence for thing in content.things])
    posterior = class_posteriors(content)
    in_question = np.array([subject is None or thing is subject for thing in content.things], dtype=bool)
    never = np.zeros(len(in_question))
    in_question &= make_questions(existence, posterior, never, never, model, numbers).bits > LEAST_BITS
    things = [content.things[i] for i in np.flatnonzero(in_question)]
    past = [past_views(thing, trajectory, files.beliefs) for thing in things]
    luck = np.array([view.hits for view in past]), np.array([view.misses for view in past])
    existence, posterior = existence[in_question], posterior[in_question]
    return _Asked(things, posterior, make_questions(existence, posterior, *luck, model, numbers), past)


class _Search:
    """Candidates, and what is known of their gains so far."""

    def __init__(
        self,
        asked: _Asked,
        volumes: Volumes,
        model: EvidenceModel,
        occluders: Occluders,
        camera: Intrinsics,
        poses: np.ndarray,
    ) -> None:
        self._things, self._volumes, self._poses, self._occluders = asked.things, volumes, poses, occluders
        self._asked, self._model = asked, model
        self._small = smaller(camera, WIDTH_PX)
        clear = empty_depth(self._small)
        self._visible = np.array([self._seen(pose, clear) for pose in poses]).reshape(len(poses), len(asked.things))
        self._sides = np.array([box_sides(volumes.boxes(pose, camera)) for pose in poses]).reshape(self._visible.shape)
        self._rendered = np.zeros(len(poses), dtype=bool)

    def best(self, count: int) -> list[tuple[int, np.ndarray]]:
        """Numbers of the best candidates, and (N,) bits that each tells of the things after those before it."""
        bounds = np.array([self._alone(number).sum() for number in range(len(self._poses))])
        compared = np.zeros(len(bounds), dtype=bool)  # with what was looked at already
        measured = np.full(len(bounds), -1)  # for the choice of which number a bound is the gain itself
        chosen: list[tuple[int, np.ndarray]] = []
        while len(chosen) < count and len(bounds):
            number = int(np.argmax(bounds))
            if bounds[number] < LEAST_BITS:
                break
            if measured[number] == len(chosen):
                chosen.append((number, self._gains(number)))
                self._look(number)
                bounds[number] = 0.0
            elif not compared[number]:
                compared[number] = True
                bounds[number] = self._gains(number).sum()
            else:
                bounds[number], measured[number] = min(bounds[number], self._measure(number)), len(chosen)
        return chosen

    def viewpoint(self, number: int, gains: np.ndarray, visited: bool) -> Viewpoint:
        """A chosen candidate, for people."""
        told = [i for i in np.argsort(-gains, kind="stable") if gains[i] >= LEAST_SHARE * gains.sum()]
        names, visible = (self._things[i].id for i in told), (float(self._visible[number, i]) for i in told)
        return Viewpoint(self._poses[number], float(gains.sum()), tuple(names), tuple(visible), visited)

    def _measure(self, number: int) -> float:
        if not self._rendered[number]:
            depth = self._occluders.depth(self._poses[number], self._small)
            self._visible[number] = self._seen(self._poses[number], depth)
            self._rendered[number] = True
        return float(self._gains(number).sum())

    def _gains(self, number: int) -> np.ndarray:
        """(N,) bits of a look at every thing, after all that was looked at."""
        gains, eye = self._alone(number), self._poses[number, :3, 3]
        for i in np.flatnonzero(gains > 0.0):
            # a look that repeats another with probability 1 - w tells w of what a new one does
            gains[i] *= self._asked.past[i].novelty(eye - self._things[i].position)
        return gains

    def _alone(self, number: int) -> np.ndarray:
        """(N,) bits of a look at every thing as if it were the first from there."""
        visible, sides = self._visible[number], self._sides[number]
        expected = self._model.detection.relative(visible, sides, posterior=self._asked.posterior)
        expected = np.where((visible > 0.0) & (sides > 0.0), expected, 0.0)
        return self._asked.questions.gains(np.arange(len(visible)), visible, expected)

    def _look(self, number: int) -> None:
        for i in np.flatnonzero(self._alone(number) > 0.0):
            self._asked.past[i].add(self._poses[number, :3, 3] - self._things[i].position)

    def _seen(self, pose: np.ndarray, depth: np.ndarray) -> np.ndarray:
        return self._volumes.visible(depth, pose, self._small, self._occluders.tolerance)
