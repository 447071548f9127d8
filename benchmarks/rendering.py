"""How fast synthetic frames are rendered: colour and noisy depth, as a mapper reads them.

uv run python benchmarks/rendering.py                    a tabletop with 30 objects
uv run python benchmarks/rendering.py --meshes FOLDER    the same with imported scans among them
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from results import show_section, table

from thingmap.datasets.errors import UserError
from thingmap.datasets.synthetic.config import ClutterLevel, Preset, SyntheticConfig
from thingmap.datasets.synthetic.rendering.camera import develop
from thingmap.datasets.synthetic.rendering.render import Renderer
from thingmap.datasets.synthetic.rendering.sensor import measure
from thingmap.datasets.synthetic.sequence import KEPT_CASTS, SyntheticSequence

TITLE = "Rendering"
WARM_UP = 3  # frames, for numba to load its kernels
MIN_FRAMES = 2 * KEPT_CASTS  # fewer would find rays cast before


@dataclass(frozen=True, slots=True, eq=False)
class Paces:
    """What was measured.

    Attributes:
        rates: by number of threads, frames a second of the clock on the wall and milliseconds of CPU a frame.
        stages: milliseconds of CPU of every frame, by stage.
        building: seconds until the sequence could be asked for frames.
        fusing: seconds for the labelled cloud.
    """

    rates: dict[int, tuple[float, float]]
    stages: dict[str, np.ndarray]
    building: float
    fusing: float


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, and write if asked to; 2 for a user's mistake."""
    options = _options(arguments)
    try:
        config = SyntheticConfig(
            Preset.TABLETOP,
            objects=options.objects,
            clutter=ClutterLevel(options.clutter),
            width=options.width,
            meshes=options.meshes,
        )
        started = time.perf_counter()
        sequence = SyntheticSequence(config)
        building = time.perf_counter() - started
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    indices = [int(k) for k in np.linspace(0, len(sequence) - 1, options.frames)]
    paces = measure_paces(sequence, indices, options.threads, building)
    show_section(TITLE, describe(sequence, paces, len(indices)), options.write)
    return 0


def measure_paces(sequence: SyntheticSequence, indices: list[int], threads: int, building: float) -> Paces:
    """Render the frames with one thread and with several, then each stage by itself."""
    cv2.setNumThreads(1)  # so that threads are counted honestly
    for index in indices[-WARM_UP:]:  # by the time these are asked for again their rays are forgotten
        sequence[index], sequence.truth(index)
    rates = {count: _rate(sequence, indices, count) for count in sorted({1, threads})}
    stages = _time_stages(sequence, indices)
    started = time.perf_counter()
    sequence.point_truth()
    return Paces(rates, stages, building, time.perf_counter() - started)


def _rate(sequence: SyntheticSequence, indices: list[int], threads: int) -> tuple[float, float]:
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(lambda _: None, range(threads)))  # threads have started
        wall, cpu = time.perf_counter(), time.process_time()
        for _ in pool.map(lambda index: sequence[index].index, indices):
            pass  # frames are dropped as they come
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    return len(indices) / wall, 1e3 * cpu / len(indices)


def _time_stages(sequence: SyntheticSequence, indices: list[int]) -> dict[str, np.ndarray]:
    """(frames,) milliseconds by stage, in one thread."""
    renderer = Renderer(sequence.scene.surfaces, sequence.scene.lights)
    camera, config = sequence.intrinsics, sequence.config
    times: dict[str, list[float]] = {}

    def timed(stage: str, work: Callable):
        started = time.thread_time()
        result = work()
        times.setdefault(stage, []).append(1e3 * (time.thread_time() - started))
        return result

    for index in indices:
        pose, rng = sequence.poses[index], np.random.default_rng(index)
        cast = timed("rays to the first surface", lambda pose=pose: renderer.cast(camera, pose))
        image = timed("textures, shadow rays, light", lambda pose=pose, cast=cast: renderer.render(camera, pose, cast))
        timed("colour image", lambda image=image, rng=rng: develop(image.radiance, 1.0, config.camera, rng))
        timed(
            "depth image",
            lambda image=image, rng=rng: measure(image.depth, image.incidence, camera, config.sensor, rng),
        )
        sequence.instances(index)  # casts the frame's rays, which the next two share
        timed("(truth of objects)", lambda index=index: sequence.truth(index))
        timed("(instance image)", lambda index=index: sequence.instances(index))
    return {stage: np.array(values) for stage, values in times.items()}


def describe(sequence: SyntheticSequence, paces: Paces, frames: int) -> str:
    """Markdown: the scene, the rates, the stages."""
    camera, scene = sequence.intrinsics, sequence.scene
    rates = ", ".join(
        f"**{rate:.1f} frames/s** with {count} thread{'s' if count > 1 else ''} ({cpu:.0f} ms of CPU a frame)"
        for count, (rate, cpu) in paces.rates.items()
    )
    counted = [stage for stage in paces.stages if not stage.startswith("(")]
    whole = sum(np.median(paces.stages[stage]) for stage in counted)
    rows = [
        (
            stage,
            f"{np.median(values):.1f}",
            f"{np.percentile(values, 95):.1f}",
            f"{100 * np.median(values) / whole:.0f} %" if stage in counted else "",
        )
        for stage, values in paces.stages.items()
    ]
    return (
        f"`{_shown_name(sequence)}`: {camera.width} x {camera.height}, {len(scene.objects)} objects and "
        f"{len(scene.clutter)} other things, {len(scene.surfaces.corners)} triangles, "
        f"{len(scene.lights.centres)} lamps with soft shadows.\n"
        f"{rates}: colour and noisy depth, over {frames} frames of the path. "
        f"Building the scene took {paces.building:.1f} s, the labelled cloud of all {len(sequence)} frames "
        f"{paces.fusing:.1f} s.\n\n"
        + table(("stage (one thread)", "median CPU ms", "p95 CPU ms", "share"), rows)
        + "\n\nStages in brackets are truth, which is computed when asked for and not part of the pace."
    )


def _shown_name(sequence: SyntheticSequence) -> str:
    """The sequence's line without the place of the meshes on this machine."""
    meshes = sequence.config.meshes
    return sequence.name if meshes is None else sequence.name.replace(str(meshes), meshes.name)


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--meshes", type=Path, metavar="DIR", help="folder of textured OBJ or GLB scans to put among the objects")
    add("--objects", type=int, default=30, metavar="N", help="things of the classes on the table (default 30)")
    add("--clutter", choices=list(ClutterLevel), default="medium", help="how much else stands there (default medium)")
    add("--width", type=int, default=640, metavar="PIXELS", help="of the 4:3 images (default 640)")
    add("--frames", type=int, default=40, metavar="N", help="frames to render, spread over the path (default 40)")
    add("--threads", type=int, default=2, metavar="N", help="to compare with one (default 2)")
    add("--write", action="store_true", help="put the results into RESULTS.md")
    options = parser.parse_args(arguments)
    if options.frames < MIN_FRAMES or options.threads < 1:
        parser.error(f"--frames counts from {MIN_FRAMES}, --threads from 1")
    return options


if __name__ == "__main__":
    sys.exit(main())
