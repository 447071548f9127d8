"""What came of a recorded sequence, in words and tables."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from known_objects import BELIEVED, MIN_EXISTENCE, Check
from results import table

from thingmap.mapper.evaluation.inputs.alignment import align_poses, align_positions, trajectory_error
from thingmap.mapper.evaluation.inputs.case import Alignment
from thingmap.mapper.map.object_map import ObjectMap
from thingmap.mapper.run_report import RunReport

ALIGNMENTS = {"positions": align_positions, "poses": align_poses}


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """A trajectory beside the truth: (N, 4, 4) `T_world_camera` of the frames that both have."""

    estimate: np.ndarray
    truth: np.ndarray

    def errors(self) -> list[float]:
        """ATE in metres under each of `ALIGNMENTS`."""
        return [trajectory_error(self.estimate, self.truth, a) for a in self.alignments().values()]

    def alignments(self) -> dict[str, Alignment]:
        """By name."""
        return {name: align(self.estimate, self.truth) for name, align in ALIGNMENTS.items()}


def describe(
    report: RunReport,
    object_map: ObjectMap,
    gravity: np.ndarray | None,
    ours: Track,
    kiss: Track,
    checks: dict[str, list[Check]],
) -> str:
    """Trajectory and checks in words and tables."""
    alignments = ours.alignments()
    angle = np.degrees(alignments["positions"].angle_to(alignments["poses"]))
    claimed = sum(thing.existence * thing.probability >= BELIEVED for thing in object_map.things)
    parts = [
        f"`{report.source}`: {report.frames_used} of {report.frames_total} frames, {report.keyframes} keyframes, "
        f"{claimed} things with existence times probability >= {BELIEVED}.",
        f"Trajectory, ATE in mm after a rigid alignment; the two alignments are {angle:.1f} degrees apart:",
        table(
            ["", *(f"aligned by {name}" for name in ALIGNMENTS)],
            [[name, *(f"{1e3 * e:.1f}" for e in t.errors())] for name, t in (("thingmap", ours), ("KISS-ICP", kiss))],
        ),
    ]
    if gravity is not None:
        up = alignments["poses"].R @ object_map.up.direction
        tilt = np.degrees(np.arccos(np.clip(-up @ gravity, -1.0, 1.0)))
        parts.append(
            f"Up is {tilt:.1f} degrees off the gravity file's (aligned by poses; its own standard deviation is "
            f"{np.degrees(object_map.up.std_rad):.1f} degrees, from {object_map.up.source})."
        )
    if any(checks.values()):
        parts += [_rule(), _check_table(checks)]
        passed = {name: sum(c.passed for c in each) for name, each in checks.items()}
        total = len(next(iter(checks.values())))
        parts.append("; ".join(f"aligned by {name}: {n} of {total} checks passed" for name, n in passed.items()) + ".")
    return "\n\n".join(parts)


def _rule() -> str:
    return (
        f"An object is found where exactly one thing of its class with existence times probability >= {BELIEVED} lies "
        f"within its tolerance, and exists with {MIN_EXISTENCE} or more. E is existence, P the probability of the "
        "class; distances in cm, aligned by " + " / ".join(ALIGNMENTS) + "."
    )


def _check_table(checks: dict[str, list[Check]]) -> str:
    rows = []
    for each in zip(*checks.values(), strict=True):
        known, thing = each[0].known, each[0].nearest
        rows.append(
            [
                known.name,
                known.label,
                "-" if thing is None else f"{thing.id} {thing.label}",
                "-" if thing is None else f"{thing.existence:.2f}",
                "-" if thing is None else f"{thing.class_posterior.get(known.label, 0.0):.2f}",
                " / ".join(_centimetres(check.distance) for check in each),
                f"{100 * known.tolerance:.0f}",
                " / ".join(_verdict(check) for check in each),
            ]
        )
    return table(["object", "class", "nearest thing", "E", "P", "distance", "tolerance", "verdict"], rows)


def _centimetres(metres: float) -> str:
    return f"{100 * metres:.0f}" if np.isfinite(metres) else "-"


def _verdict(check: Check) -> str:
    if check.passed:
        return "ok"
    if check.known.is_false:
        return "FALSE"
    if not check.matches:
        return "MISSING"
    return "TWICE" if len(check.matches) > 1 else "UNSURE"
