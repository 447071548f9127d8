"""Links between keyframes that are not neighbours: local ones by depth, loop closures by image, depth and things.

A keyframe is matched by depth with the nearest places of three ages, as far as it is known how they lie: that holds a
trajectory far better than its steps alone. Where that is not known, after drift or after being lost, places that look
alike are verified by features, then by depth; or places whose things lie alike. What passes enters the graph a fixed
number of keyframes later (so that a run does not depend on how fast the other process is), with Huber's loss; from
time to time all loop closures are checked together by GNC (`estimation.pose_graph`), and the wrong ones leave.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from itertools import count

import numpy as np

from ...config import MapperConfig
from ...deferred import Deferred
from ...estimation.pose_graph import LoopCheck, PoseGraph, check_loops
from ...estimation.records import Link, Loop, ScanMatch
from ...estimation.smoother import Smoother
from ..constellation.candidates import LoopCandidate
from ..known_place import is_wide
from ..rigid import chi_square, inverse, pose_covariance
from ..sparse_frames import SparseFrames
from ..visual.features import Features
from .link_jobs import Candidate, LinkConfig, LinkFound, LinkJob, LinkKind, find_links
from .places import Place, Places
from .scan_matching import Scan
from .unconfirmed import Unconfirmed

UNMEASURED = 100.0  # variances of guessed motions are taken this many times, where loops are checked

_owners = count()


class LoopCloser:
    """Proposes links, has them verified, and puts them into the smoother.

    Args:
        config: of the whole mapper.
        smoother: whose keyframes are linked.
        sparse: what links lack where frames are far apart.
    """

    def __init__(self, config: MapperConfig, smoother: Smoother, sparse: SparseFrames) -> None:
        self._config, self._smoother, self._sparse = config.loops, smoother, sparse
        self._spacing = config.scans.spacing
        self._places = Places(config.loops, config.places)
        features = replace(config.visual, min_inliers=config.loops.min_inliers)
        self._link = LinkConfig(config.scans, features, config.loops.agreement, config.seed)
        self._owner = next(_owners)
        self._jobs = Deferred(find_links, config.loops.lag, config.loops.process)
        self._checks = Deferred(check, config.loops.check_lag, config.loops.process)
        self._unchecked = 0  # loops since the last check
        self._unmeasured = Unconfirmed()
        self._last_linked = -(10**9)  # keyframe that was last tied to a place older than all of `ages`
        self.outcomes: Counter[str] = Counter()

    def add_keyframe(self, keyframe: int, features: Features, points: np.ndarray, adrift: bool = False) -> None:
        """Has the latest keyframe matched, once it is solved.

        Args:
            keyframe: its number.
            features: of its image.
            points: (N, 3) of its depth, camera frame, metres.
            adrift: the camera does not know its place: young places may be the way back too.
        """
        place = Place(keyframe, features, Scan.of(points, self._spacing))
        poses = self._smoother.poses()
        self._submit(place, (*self._near(keyframe, poses), *self._alike(place, adrift)))
        self._places.offer(place, poses)

    def propose(self, keyframe: int, candidates: Iterable[LoopCandidate]) -> None:
        """Has pairs of keyframes matched that saw the same things; the nearest places stand for them."""
        poses, tried = self._smoother.poses(), set()
        for candidate in candidates:
            old, recent = (self._nearest_place(k, poses) for k in (candidate.old, candidate.recent))
            if old is None or recent is None or recent - old < self._config.min_age or (old, recent) in tried:
                continue  # where an old place stands for the recent keyframe too, it is known well how they lie
            tried.add((old, recent))
            T_old_old, T_recent_recent = (
                inverse(poses[a]) @ poses[b] for a, b in ((old, candidate.old), (candidate.recent, recent))
            )
            guess = T_old_old @ candidate.T_old_recent @ T_recent_recent
            one = Candidate(self._places[old], LinkKind.SAME_THINGS, guess)
            self._submit(self._places[recent], (one,), keyframe)

    def collect(self, keyframe: int, adrift: bool = False) -> bool:
        """Puts what is due by this keyframe into the smoother, to be solved with it; whether a loop was closed.

        While the camera is `adrift` everything is waited for, since nothing is mapped until a place is recognised; and
        no place that looks alike is refused for where it is: the first one may have been the wrong one.
        """
        links = [link for links in (self._jobs.drain() if adrift else self._jobs.due(keyframe)) for link in links]
        verdicts = self._checks.due(keyframe)
        return self._take(links, verdicts, keyframe, adrift)

    def finish(self, keyframe: int) -> bool:
        """Puts all that is outstanding into the smoother; whether a loop was closed."""
        links = [link for links in self._jobs.drain() for link in links]
        closed = self._take(links, self._checks.drain(), keyframe)
        self._take([], self._checks.drain(), keyframe)  # of the check that these may have called for
        return closed

    def has_old_links(self, keyframe: int) -> bool:
        """Whether the camera was lately tied to a place of long ago: no other way of finding one is needed then."""
        return self._last_linked >= keyframe - self._config.ages[0] - self._config.lag

    def statistics(self) -> dict[str, int]:
        """Numbers of places, of links by their kind, and of those refused."""
        return {"places": len(self._places), **dict(sorted(self.outcomes.items()))}

    # -- candidates

    def _near(self, keyframe: int, poses: np.ndarray) -> list[Candidate]:
        """The nearest place of each age, where the views overlap and it is known well enough how they lie."""
        c, numbers = self._sparse.reaching(self._config), self._places.keyframes
        if not len(numbers):
            return []
        turned, moved = self._places.distances(poses, keyframe)
        apart = np.hypot(turned / c.reach[0], moved / c.reach[1])
        known = _is_known(self._smoother.path_covariances(keyframe)[numbers], c.known)
        usable = (apart < 1.0) & known & (numbers <= keyframe - c.skip)
        age, candidates = keyframe - numbers, []
        for youngest, oldest in zip((0, *c.ages), (*c.ages, np.inf), strict=True):
            of_age = np.flatnonzero(usable & (age > youngest) & (age <= oldest))
            if len(of_age):
                best = int(numbers[of_age[np.argmin(apart[of_age])]])
                guess = inverse(poses[best]) @ poses[keyframe]
                candidates.append(Candidate(self._places[best], LinkKind.NEAR, guess))
        return candidates

    def _alike(self, place: Place, adrift: bool) -> list[Candidate]:
        """Places that look alike, if there is no old place of which it is known how it lies."""
        c = self._config
        youngest = place.keyframe - (c.skip if adrift else c.min_age)
        if youngest < 0 or (self.has_old_links(place.keyframe) and not adrift):
            return []
        found = self._places.alike(place.features, c.candidates, youngest)
        return [Candidate(one, LinkKind.ALIKE, None) for one in found]

    def _nearest_place(self, keyframe: int, poses: np.ndarray) -> int | None:
        """A place that can stand for a keyframe: near it, and it is known how they lie, whatever drifted elsewhere."""
        numbers, c = self._places.keyframes, self._config
        if not len(numbers):
            return None
        turned, moved = self._places.distances(poses, keyframe)
        variances = np.diagonal(self._smoother.path_covariances(keyframe)[numbers], axis1=1, axis2=2)
        unknown = (
            np.sqrt(variances[:, :3].max(axis=1)) / c.known[0] + np.sqrt(variances[:, 3:].max(axis=1)) / c.known[1]
        )
        return int(numbers[np.argmin(np.hypot(turned / c.reach[0], moved / c.reach[1]) + unknown)])

    def _submit(self, place: Place, candidates: tuple[Candidate, ...], keyframe: int | None = None) -> None:
        if candidates:
            turn = place.keyframe if keyframe is None else keyframe
            self._jobs.submit(turn, LinkJob(self._owner, place, candidates, self._link))

    # -- verdicts

    def _take(self, links: list[LinkFound], verdicts: list[LoopCheck], keyframe: int, adrift: bool = False) -> bool:
        closed = False
        poses = self._smoother.poses() if links else np.empty((0, 4, 4))
        # before any enters: the first of several would make the others look too far off
        known = {b: self._smoother.path_covariances(b) for b in {link.b for link in links}}
        missing = self._sparse.missing()
        for link in (_widened(link, missing) for link in links):
            if adrift and link.kind is LinkKind.ALIKE:
                closed |= self._add(link, agrees=True)
            elif is_wide(known[link.b][link.a]):
                for one in self._unmeasured.confirmed(link, poses):
                    closed |= self._add(one, agrees=True)
            else:
                closed |= self._add(link, self._agrees(link, poses, known[link.b][link.a]))
        for verdict in verdicts:
            wrong = verdict.outliers & self._smoother.loops().keys()
            self.outcomes["loops found wrong"] += len(wrong)
            self._smoother.drop_loops(wrong)
        if self._unchecked and keyframe % self._config.check_every == 0:
            self._unchecked = 0
            self._smoother.settle()
            graph = PoseGraph.of(self._smoother.ledger)
            graph = replace(graph, motions=tuple(_loosened(motion) for motion in graph.motions))
            self._checks.submit(keyframe, (graph, self._smoother.poses(), self._config.probability))
        return closed

    def _add(self, link: LinkFound, agrees: bool) -> bool:
        """A link that agrees with the estimate enters the graph; whether it closes a loop."""
        if not agrees:
            self.outcomes[f"{link.kind.value}, refused"] += 1
            return False
        self.outcomes[link.kind.value] += 1
        if link.b - link.a > self._config.ages[-1]:
            self._last_linked = max(self._last_linked, link.b)
        motion = link.a, link.b, link.motion.T_a_b, link.motion.covariance
        if link.kind is LinkKind.NEAR:
            self._smoother.add(ScanMatch(*motion))
            return False
        self._smoother.add(Loop(*motion))
        self._unchecked += 1
        return True

    def _agrees(self, link: LinkFound, poses: np.ndarray, known: np.ndarray) -> bool:
        """Whether a link lies within the gate around the estimate."""
        covariance = known + link.motion.covariance + pose_covariance(self._config.gate_floor)
        T_estimated = inverse(poses[link.a]) @ poses[link.b]
        return chi_square(link.motion.T_a_b, T_estimated, covariance) < self._config.gate


def _is_known(covariances: np.ndarray, known: tuple[float, float]) -> np.ndarray:
    """(P,) bool, of (P, 6, 6) covariances of relative poses: their deviations are below `known`, rad and m."""
    variances = np.diagonal(covariances, axis1=1, axis2=2)
    turn, move = variances[:, :3].max(axis=1), variances[:, 3:].max(axis=1)
    return (turn < known[0] ** 2) & (move < known[1] ** 2)


def _widened(link: LinkFound, missing: np.ndarray) -> LinkFound:
    """With (6, 6) added to its covariance."""
    return replace(link, motion=replace(link.motion, covariance=link.motion.covariance + missing))


def _loosened(motion: Link) -> Link:
    """A motion that nothing measured, left so open that no loop is found wrong for its sake."""
    return replace(motion, covariance=UNMEASURED * motion.covariance) if is_wide(motion.covariance) else motion


def check(job: tuple[PoseGraph, np.ndarray, float]) -> LoopCheck:
    """`check_loops` of one argument, for another process."""
    return check_loops(*job)
