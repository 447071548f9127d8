"""How fast the visibility of 100 volumes is measured, and what sampling every second pixel costs in accuracy.

uv run python benchmarks/visibility.py                   100 volumes in a frame of a cluttered survey
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from results import show_section, table

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import Frame
from thingmap.datasets.synthetic.sequence import SyntheticSequence
from thingmap.datasets.synthetic.synth import open_synth
from thingmap.factors.depth_likelihood import DepthLikelihood
from thingmap.factors.visibility import Visibility, VolumePart, measure_visibility
from thingmap.mapper.evaluation.things.errors import extents_along

TITLE = "Visibility"
SCENE = "survey?seed=7&clutter=high"
STEPS = (1, 2, 4)
LIMITS = (5.0, 0.02)  # ms for 100 volumes at step 2, and its mean ratio error
RANGES = (0.6, 3.0)  # m from the camera, of the random volumes
RATIOS = ("occluded", "agreeing", "free")


@dataclass(frozen=True, slots=True, eq=False)
class Volumes:
    """Upright volumes in a frame: the first `true` ones are where things are, the others anywhere in view.

    Attributes:
        centers, log_half_axes: (N, 3) metres, world, and log of metres.
        true: how many are of things.
    """

    centers: np.ndarray
    log_half_axes: np.ndarray
    true: int


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """One step.

    Attributes:
        ms: median CPU time; and
        ms_without: of the depth likelihood.
        error, worst: mean and largest difference of a ratio from step 1, over volumes, parts and outcomes.
        log_ratio_error: nats per pixel, mean difference of the depth log ratio.
    """

    ms: float
    ms_without: float
    error: float
    worst: float
    log_ratio_error: float


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, and write if asked to; 2 for a user's mistake."""
    options = _options(arguments)
    try:
        sequence = open_synth(options.scene)
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    frame = sequence[len(sequence) // 2]
    volumes = place_volumes(sequence, frame, options.volumes, np.random.default_rng(7))
    steps, pixels = measure_steps(frame, volumes, options.repeats)
    show_section(TITLE, describe(options.scene, frame, volumes, steps, pixels), options.write)
    return 0


def place_volumes(sequence: SyntheticSequence, frame: Frame, count: int, rng: np.random.Generator) -> Volumes:
    """Up to half of the volumes on the scene's things, the others of the same sizes anywhere in the frame's view."""
    things = [*sequence.objects, *sequence.clutter][: count // 2]
    half = np.array([extents_along(thing.size, thing.yaw) / 2.0 for thing in things]).reshape(-1, 3)
    k, T, others = frame.intrinsics, frame.T_world_camera, count - len(things)
    if T is None or not len(things):
        raise ValueError(f"expected a posed frame and things to take sizes from, but got {len(things)} things")
    uv = rng.uniform([0.0, 0.0], [k.width, k.height], (others, 2))
    anywhere = k.back_project(uv, rng.uniform(*RANGES, others)) @ T[:3, :3].T + T[:3, 3]
    centers = np.concatenate([[thing.position for thing in things], anywhere])
    return Volumes(centers, np.log(np.concatenate([half, half[rng.integers(len(half), size=others)]])), len(things))


def measure_steps(frame: Frame, volumes: Volumes, repeats: int) -> tuple[dict[int, Measured], np.ndarray]:
    """What every step takes and how far it is from step 1, and the (N,) pixels of the volumes."""
    fine = _measure(frame, volumes, 1, DepthLikelihood())
    measured = {}
    for step in STEPS:
        seen = _measure(frame, volumes, step, DepthLikelihood())
        errors = np.abs([getattr(seen, name) - getattr(fine, name) for name in RATIOS])
        spoken = np.minimum(seen.readings, fine.readings) > 0
        nats = np.abs(seen.depth_log_ratio - fine.depth_log_ratio)[spoken]
        times = [_time(frame, volumes, step, likelihood, repeats) for likelihood in (DepthLikelihood(), None)]
        measured[step] = Measured(times[0], times[1], float(errors.mean()), float(errors.max()), float(nats.mean()))
    return measured, fine.pixels


def _measure(frame: Frame, volumes: Volumes, step: int, likelihood: DepthLikelihood | None) -> Visibility:
    T = frame.T_world_camera
    assert T is not None
    place = volumes.centers, volumes.log_half_axes
    return measure_visibility(frame.depth, frame.intrinsics, T, np.eye(3), *place, step=step, likelihood=likelihood)


def _time(frame: Frame, volumes: Volumes, step: int, likelihood: DepthLikelihood | None, repeats: int) -> float:
    """Median milliseconds of this thread, which is all that works."""
    times = []
    for _ in range(repeats):
        started = time.thread_time()
        _measure(frame, volumes, step, likelihood)
        times.append(1e3 * (time.thread_time() - started))
    return float(np.median(times))


def describe(scene: str, frame: Frame, volumes: Volumes, steps: dict[int, Measured], pixels: np.ndarray) -> str:
    """Markdown: the scene, a row for each step, and whether step 2 keeps its limits."""
    k, count = frame.intrinsics, len(volumes.centers)
    rows = [
        (
            step,
            f"{m.ms:.2f}",
            f"{m.ms_without:.2f}",
            f"{m.ms / steps[2].ms:.1f}",
            f"{m.error:.4f}",
            f"{m.worst:.2f}",
            f"{m.log_ratio_error:.3f}",
        )
        for step, m in steps.items()
    ]
    head = ("step", "ms", "ms without depth likelihood", "to step 2", "mean ratio error", "largest", "nats a pixel")
    kept = steps[2].ms * 100 / count <= LIMITS[0] and steps[2].error < LIMITS[1]
    return (
        f"`synth:{scene}`, {k.width} x {k.height}: {count} volumes x {len(VolumePart)} parts on one core, "
        f"{volumes.true} of them at things and the others {RANGES[0]:g} to {RANGES[1]:g} m away at random; "
        f"{(pixels > 0).sum()} in the image, {np.median(pixels):.0f} pixels each (median), {pixels.sum() / 1e3:.0f} k "
        "in all. Errors are against step 1.\n\n"
        + table(head, rows)
        + f"\n\nStep 2 {'keeps' if kept else 'does NOT keep'} its limits: {LIMITS[0]:g} ms for 100 volumes and a mean "
        f"ratio error of {LIMITS[1]:g}."
    )


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--scene", default=SCENE, metavar="LINE", help=f"of the synthetic world (default {SCENE})")
    add("--volumes", type=int, default=100, metavar="N", help="to measure (default 100)")
    add("--repeats", type=int, default=50, metavar="N", help="of every measurement, for the median (default 50)")
    add("--write", action="store_true", help="put the results into RESULTS.md")
    options = parser.parse_args(arguments)
    if options.volumes < 2 or options.repeats < 1:
        parser.error("--volumes counts from 2, --repeats from 1")
    return options


if __name__ == "__main__":
    sys.exit(main())
