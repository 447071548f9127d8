"""Scenes rendered once, sequences mapped, configurations changed, many of these at a time in processes of their own."""

from __future__ import annotations

import multiprocessing
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numba
import numpy as np
from kiss_alone import KissAlone
from trajectory_measures import Mapped

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import BrokenFrame
from thingmap.datasets.open import open_sequence
from thingmap.datasets.sequence import Sequence as Frames
from thingmap.datasets.synthetic.config import SyntheticConfig
from thingmap.datasets.synthetic.files.writing import write_sequence
from thingmap.datasets.synthetic.sequence import SyntheticSequence
from thingmap.datasets.synthetic.synth import PREFIX, synth_line
from thingmap.datasets.views import usable_frames
from thingmap.detectors.spec import make_detector
from thingmap.mapper.config import MapperConfig
from thingmap.mapper.estimation.ledger import Ledger
from thingmap.mapper.mapper import SemanticMapper
from thingmap.mapper.runner import run_sequence
from thingmap.mapper.trajectory.keyframes import KeyframeSelector
from thingmap.mapper.trajectory.odometry.odometry import Tracking
from thingmap.mapper.trajectory.odometry.sources import make_odometry
from thingmap.mapper.trajectory.rigid import inverse

APART = (1, 5, 20)  # keyframes, between those whose relative pose is judged
PAIRS = 60  # at most, of a sequence


def scene_folder(config: SyntheticConfig, folder: Path) -> Path:
    """Where a rendered scene is; the name says all that the rendering depends on."""
    return folder / "scenes" / synth_line(config).removeprefix(PREFIX).replace("?", "-").replace("&", "-")


def render(config: SyntheticConfig, folder: Path) -> None:
    """Writes a scene with its truth, on all cores, unless it is there: poses are the last file but one."""
    place = scene_folder(config, folder)
    if not (place / "poses.txt").is_file():
        write_sequence(SyntheticSequence(config), place, overwrite=place.exists())


def changed(config: MapperConfig, changes: Mapping[str, Any]) -> MapperConfig:
    """A configuration with other values at dotted names, such as "smoother.joint".

    Raises:
        UserError: there is no such name.
    """
    for name, value in changes.items():
        try:
            config = _changed(config, name.split("."), value)
        except LookupError:
            raise UserError(f"the mapper's configuration has no {name}") from None
    return config


def _changed(config: Any, names: Sequence[str], value: Any) -> Any:
    if not is_dataclass(config) or names[0] not in {field.name for field in fields(config)}:
        raise LookupError(names[0])
    inner = _changed(getattr(config, names[0]), names[1:], value) if len(names) > 1 else value
    return replace(config, **{names[0]: inner})  # type: ignore[type-var]


def map_sequence(sequence: Frames, detector: str, config: MapperConfig) -> Mapped:
    """By the whole mapper."""
    mapper = SemanticMapper(make_detector(detector, sequence), config, source=sequence.name, gravity=sequence.gravity)
    run_sequence(sequence, mapper)
    with tempfile.TemporaryDirectory() as temporary:
        path = Path(temporary) / "ledger.npz"
        mapper.save_ledger(path)
        ledger, _ = Ledger.load(path)
    stamps, poses = mapper.trajectory()
    outcomes = mapper.statistics().get("tracking", {})
    keyframe_stamps, keyframe_poses, _ = mapper.keyframes()
    pairs = {n: _pairs(mapper, keyframe_poses, n) for n in APART}
    return Mapped(stamps, poses, keyframe_stamps, ledger, outcomes, pairs)


def _pairs(mapper: SemanticMapper, poses: np.ndarray, apart: int) -> list[tuple[int, int, np.ndarray, np.ndarray]]:
    """(a, b, T_a_b, covariance) of keyframes so many apart; no two of the pairs overlap, and at most `PAIRS`."""
    first = range(0, len(poses) - apart, max(apart, len(poses) // PAIRS))
    return [
        (a, a + apart, inverse(poses[a]) @ poses[a + apart], mapper.relative_covariance(a, a + apart)) for a in first
    ]


def track_sequence(sequence: Frames, config: MapperConfig, kiss_alone: bool = False) -> Mapped:
    """By the configuration's odometry alone, or by KISS-ICP without anything of ours."""
    odometry, stamps, poses, outcomes = None, [], [], Counter()
    selector = KeyframeSelector(config.keyframes)
    for frame in usable_frames(sequence, lambda broken: None):
        if odometry is None:
            alone = KissAlone(config.odometry) if kiss_alone else None
            odometry = alone or make_odometry(config.odometry, frame.scan is not None)
        try:
            tracking = odometry.register(frame)
        except BrokenFrame:
            continue
        if isinstance(tracking, Tracking):
            outcomes[tracking.outcome.value] += 1
            if not isinstance(odometry, KissAlone) and selector.is_keyframe(
                tracking.T_odometry_camera, tracking.outcome
            ):
                odometry.keyframe()  # by which it tells what the geometry in view leaves open
        stamps.append(frame.stamp)
        poses.append(tracking.T_odometry_camera if isinstance(tracking, Tracking) else tracking)
    return Mapped(np.array(stamps), np.array(poses).reshape(-1, 4, 4), np.empty(0), Ledger(), outcomes)


def open_one(path: Path, frames: int | None) -> Frames:
    """The first frames of a sequence, in a process that keeps to one thread."""
    numba.set_num_threads(1)
    cv2.setNumThreads(1)
    return open_sequence(path, max_frames=frames)


def run_all(work: Callable[..., Any], calls: Mapping[Any, tuple[Any, ...]], workers: int) -> dict[Any, Any]:
    """`work(*call)` of every call, by the call's key; with 0 workers in this process, one after the other."""
    if workers == 0:
        return {key: work(*call) for key, call in calls.items()}
    start, done = time.perf_counter(), {}
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context) as pool:
        waiting = {pool.submit(work, *call): key for key, call in calls.items()}
        try:
            for future in as_completed(waiting):
                done[waiting[future]] = future.result()
                minutes = (time.perf_counter() - start) / 60.0
                said = f"{len(done)}/{len(calls)} after {minutes:.1f} min: {waiting[future]}"
                print(said, file=sys.stderr, flush=True)
        finally:
            pool.shutdown(cancel_futures=True)  # after a failure nobody waits for the others
    return {key: done[key] for key in calls}
