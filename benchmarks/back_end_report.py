"""Time per keyframe of the back end at several sizes of the graph, and whether what it estimates is right."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from back_end import BackEnd
from back_end_views import SimulatedView, simulate
from back_end_world import CLASSES, make_world
from results import table

from thingmap.mapper.config import MapperConfig
from thingmap.mapper.estimation.outcomes import Outcome
from thingmap.mapper.evaluation.inputs.alignment import align_positions, trajectory_error

SEEN = 10  # keyframes with a detection, after which an object should be in the map
LAST = 100  # keyframes over which times are taken
LAPS_PER_KEYFRAME = 4 / 1000  # 4 cm and 2 degrees from one keyframe to the next
TARGET_MEDIAN_MS, TARGET_P95_MS = 20.0, 50.0  # at 1000 keyframes


@dataclass(frozen=True, slots=True)
class Mark:
    """CPU milliseconds per keyframe over the last `LAST` keyframes before this one; `stages` has medians and p95s."""

    keyframes: int
    median_ms: float
    p95_ms: float
    stages: dict[str, tuple[float, float]]
    detections: float
    landmarks: int


@dataclass(frozen=True, slots=True, eq=False)
class Quality:
    """What the map is worth in the end.

    Attributes:
        seen: objects detected in at least `SEEN` keyframes.
        phantoms: how many there are.
        class_accuracy: share of the objects' landmarks with the right likeliest class.
        log_size_error: (3,) root mean square per axis of the upright frame.
        worst_log_size: the largest error of any axis of any object.
        position_error: median, metres.
        trajectory_error: ATE after alignment, metres.
        lost: of the objects seen, those without a landmark, or with one whose existence is below 0.5.
        ghosts: landmarks on phantoms whose existence is 0.5 or more.
        rebuilds: of ISAM2.
        merged: landmarks merged; nothing should be, as no two things touch.
    """

    seen: int
    phantoms: int
    class_accuracy: float
    log_size_error: np.ndarray
    worst_log_size: float
    position_error: float
    trajectory_error: float
    lost: int
    ghosts: int
    rebuilds: int
    merged: int


def run_back_end(
    marks: Sequence[int], objects: int, phantoms: int, seed: int = 0, config: MapperConfig | None = None
) -> tuple[list[Mark], Quality]:
    """Drive the back end to the last mark."""
    rng, end = np.random.default_rng(seed), max(marks)
    world = make_world(objects, phantoms, rng)
    back_end, views, taken = BackEnd(world, config), [], []
    for view in simulate(world, end, end * LAPS_PER_KEYFRAME, rng):
        back_end.add(view)
        views.append(view)
        if view.keyframe + 1 in marks:
            taken.append(_mark(back_end, views))
    back_end.finish()
    return taken, _judge(back_end, views)


def describe_back_end(marks: list[Mark], quality: Quality, objects: int) -> str:
    """Tables of times and of quality."""
    q, stages = quality, list(marks[-1].stages)
    rows = [
        [m.keyframes, m.landmarks, f"{m.detections:.1f}", f"{m.median_ms:.1f}", f"{m.p95_ms:.1f}"]
        + [f"{m.stages[name][0]:.1f} / {m.stages[name][1]:.1f}" for name in stages]
        for m in marks
    ]
    size = ", ".join(f"{axis:.3f}" for axis in q.log_size_error)
    facts = [
        ["class accuracy", f"{q.class_accuracy:.3f}"],
        ["log-size error (x, y, z)", f"{size}; worst {q.worst_log_size:.2f}"],
        ["position error, median", f"{1e3 * q.position_error:.0f} mm"],
        ["ATE", f"{1e3 * q.trajectory_error:.1f} mm"],
        ["objects lost", f"{q.lost} of {q.seen}"],
        ["phantoms taken for objects", f"{q.ghosts} of {q.phantoms}"],
        ["wrong merges", q.merged],
        ["graph rebuilds", q.rebuilds],
    ]
    target = f"At 1000 keyframes the targets are {TARGET_MEDIAN_MS:.0f} ms (median) and {TARGET_P95_MS:.0f} ms (p95)."
    return "\n\n".join(
        [
            f'{objects} objects and {q.phantoms} phantoms of {len(CLASSES)} classes and "not an object", association '
            f"known. CPU milliseconds a keyframe over the last {LAST} keyframes; for the stages median / p95. {target}",
            table(["keyframes", "landmarks", "detections", "median", "p95", *stages], rows),
            f"After the last keyframe, with {q.seen} objects seen in {SEEN} keyframes or more:",
            table(["", ""], facts),
        ]
    )


def _mark(back_end: BackEnd, views: list[SimulatedView]) -> Mark:
    last = back_end.clock.keyframes[-LAST:]
    totals = [sum(keyframe.values()) for keyframe in last]
    stages = {}
    for name in last[-1]:
        median, p95 = np.percentile([keyframe[name] for keyframe in last], (50, 95))
        stages[name] = float(median), float(p95)
    median, p95 = np.percentile(totals, (50, 95))
    detections = float(np.mean([len(view.detections) for view in views[-LAST:]]))
    return Mark(len(views), float(median), float(p95), stages, detections, len(back_end.scene.landmarks))


def _judge(back_end: BackEnd, views: list[SimulatedView]) -> Quality:
    world, estimate = back_end.world, back_end.smoother.poses()
    truth = np.array([view.T_world_camera for view in views])
    detected = Counter(thing for view in views for thing in view.detections)
    seen = {thing for thing, times in detected.items() if thing < world.objects and times >= SEEN}
    real, phantom = {}, {}
    for landmark in back_end.scene.landmarks.values():
        thing = back_end.thing_of(landmark.belief)
        (real if thing < world.objects else phantom)[thing] = landmark
    right = [int(np.argmax(x.belief.class_posterior())) == world.label[j] for j, x in real.items()]
    size = np.array([x.log_size - world.log_sizes[j] for j, x in real.items()]).reshape(-1, 3)
    position = [float(np.linalg.norm(x.position - world.positions[j])) for j, x in real.items()]
    existing = {thing for thing, x in real.items() if x.belief.existence >= 0.5}
    return Quality(
        seen=len(seen),
        phantoms=len(world) - world.objects,
        class_accuracy=float(np.mean(right)) if right else 0.0,
        log_size_error=np.sqrt((size**2).mean(axis=0)) if right else np.full(3, np.nan),
        worst_log_size=float(np.abs(size).max()) if right else np.nan,
        position_error=float(np.median(position)) if right else np.nan,
        trajectory_error=trajectory_error(estimate, truth, align_positions(estimate, truth)),
        lost=len(seen - existing),
        ghosts=sum(x.belief.existence >= 0.5 for x in phantom.values()),
        rebuilds=back_end.smoother.rebuilds,
        merged=back_end.outcomes[Outcome.MERGED],
    )
