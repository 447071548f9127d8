"""Evidence in voxels: milliseconds a frame, bytes a voxel, memory, on rooms that are known exactly.

uv run python benchmarks/voxels.py             100 frames of 640 x 480 in each setting
uv run python benchmarks/voxels.py --quick     12 frames: whether everything works

A camera turns in a room of plane walls with a Kinect's noise. Times are of one thread's CPU, after compilation.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from json import dumps, loads
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from memory import MB, resident_mb
from results import show_section, table

from thingmap.datasets.frame import Frame, Intrinsics
from thingmap.mapper.labelling.pixel_evidence import pixel_grid
from thingmap.mapper.labelling.surface import surface_of
from thingmap.mapper.labelling.voxel_config import VoxelConfig
from thingmap.mapper.labelling.voxels import VoxelEvidence

TITLE = "Evidence in voxels"
CAMERA = Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5)
FRAMES, QUICK = 100, 12
NOISE = 0.0014  # 1/m: a Kinect's standard deviation of depth over its square
LIMIT_MS = 5.0  # a frame, of six classes at 1 cm
NEAR, FAR = 0.2, 4.0  # m


@dataclass(frozen=True, slots=True)
class Setting:
    """What is added: a room of half side `half` metres, K classes, of which `spoken` are in boxes or, if 0, all."""

    name: str
    half: float
    classes: int
    spoken: int
    memory: int


SETTINGS = (
    Setting("table at 1.2 m, 6 classes", 1.2, 6, 0, VoxelConfig().memory),
    Setting("room at 2.5 m, 6 classes", 2.5, 6, 0, VoxelConfig().memory),
    Setting("the same, 20 MB, rest on disk", 2.5, 6, 0, 20_000_000),
    Setting("table at 1.2 m, 80 classes in boxes", 1.2, 80, 3, VoxelConfig().memory),
    Setting("table at 1.2 m, 80 classes everywhere", 1.2, 80, 0, VoxelConfig().memory),
)


@dataclass(frozen=True, slots=True)
class Measured:
    """Medians in ms a frame; bytes; MB (10^6 bytes)."""

    name: str
    points: int
    surface_ms: float
    add_ms: float
    add_mean_ms: float
    assemble_s: float
    world_voxels: int
    held_voxels: int
    frozen_bytes: float
    row_bytes: float
    arrays_mb: float
    bound_mb: float
    peak_mb: float
    error: float
    submaps: int
    spilled: int


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, and write if asked to."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="few frames")
    parser.add_argument("--write", action="store_true", help="put the table into RESULTS.md")
    parser.add_argument("--one", nargs=2, metavar=("SETTING", "FRAMES"), help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.one:
        print(dumps(asdict(measure(SETTINGS[int(options.one[0])], int(options.one[1])))))
        return 0
    frames = QUICK if options.quick else FRAMES
    show_section(TITLE, describe([_measure_apart(number, frames) for number in range(len(SETTINGS))]), options.write)
    return 0


def _measure_apart(number: int, frames: int) -> Measured:
    """In a process of its own, so that memory is that of one setting."""
    command = [sys.executable, str(Path(__file__)), "--one", str(number), str(frames)]
    return Measured(**loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout))


def measure(setting: Setting, frames: int) -> Measured:
    """Add `frames` frames, every one a keyframe, over a full turn, and assemble."""
    rng = np.random.default_rng(0)
    poses = np.stack([pose(number / frames) for number in range(frames)])
    names = [f"class {k}" for k in range(setting.classes)]
    _warm_up(setting, names)
    surface_ms, add_ms, arrays, peak, points, before = [], [], 0, 0.0, 0, resident_mb() or np.nan
    with TemporaryDirectory() as folder:
        evidence = VoxelEvidence(names, VoxelConfig(memory=setting.memory), Path(folder))
        for number in range(frames):
            frame = render(poses[number], setting.half, rng, number)
            uv = pixel_grid(frame, evidence.config.pixel_step, NEAR, FAR)
            log_p = classes_of(uv, setting, rng)
            start = time.process_time()
            surface = surface_of(frame, uv)
            middle = time.process_time()
            evidence.add(number, np.eye(4), surface.points, surface.normals, surface.colours, log_p, poses)
            surface_ms.append(1e3 * (middle - start))
            add_ms.append(1e3 * (time.process_time() - middle))
            arrays, points = max(arrays, evidence.nbytes), max(points, len(uv))
            peak = max(peak, (resident_mb() or np.nan) - before)
        start = time.process_time()
        voxels = evidence.assemble(poses)
        assemble_s = time.process_time() - start
        held, frozen, row = _sizes(evidence, points)
    return Measured(
        name=setting.name,
        points=points,
        surface_ms=float(np.median(surface_ms)),
        add_ms=float(np.median(add_ms)),
        add_mean_ms=float(np.mean(add_ms)),
        assemble_s=assemble_s,
        world_voxels=len(voxels),
        held_voxels=held,
        frozen_bytes=frozen,
        row_bytes=row,
        arrays_mb=arrays / MB,
        bound_mb=evidence.memory_bound(points) / MB,
        peak_mb=peak,
        error=0.0 if voxels.log_p_error is None else float(np.median(voxels.log_p_error)),
        submaps=evidence.submaps[0],
        spilled=evidence.submaps[1],
    )


def _warm_up(setting: Setting, names: list[str]) -> None:
    """Compile everything."""
    rng = np.random.default_rng(1)
    frame = render(np.eye(4), setting.half, rng, 0)
    uv = pixel_grid(frame, 8, NEAR, FAR)
    surface = surface_of(frame, uv)
    evidence = VoxelEvidence(names, VoxelConfig())
    for number in range(2):
        log_p = classes_of(uv, setting, rng)
        evidence.add(number, np.eye(4), surface.points, surface.normals, surface.colours, log_p)
    evidence.assemble(np.tile(np.eye(4), (2, 1, 1)))


def _sizes(evidence: VoxelEvidence, points: int) -> tuple[int, float, float]:
    """Voxels of all submaps, bytes of each when finished, and of each row of one that grows."""
    rows = evidence.config.submap_voxels + points
    row = (evidence.memory_bound(points) - evidence.config.memory) / rows
    with TemporaryDirectory() as folder:
        evidence.save(Path(folder) / "voxels.npz")
        with np.load(Path(folder) / "voxels.npz") as content:
            cells = [content[name] for name in content.files if name.endswith("_cells")]
        size = (Path(folder) / "voxels.npz").stat().st_size
    held = sum(len(array) for array in cells)
    return held, size / held, row


def pose(turn: float) -> np.ndarray:
    """(4, 4) T_world_camera after a share of a full turn about the vertical, half a metre from its axis."""
    c, s = np.cos(2.0 * np.pi * turn), np.sin(2.0 * np.pi * turn)
    T = np.eye(4)
    T[:3, :3] = [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]
    T[:3, 3] = 0.3 * s, 0.0, 0.3 * c
    return T


def render(T: np.ndarray, half: float, rng: np.random.Generator, number: int) -> Frame:
    """What the camera sees in a room from -half to half, metres."""
    u, v = np.meshgrid(np.arange(CAMERA.width), np.arange(CAMERA.height))
    rays = np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones(u.shape)], axis=-1)
    rays = rays @ T[:3, :3].T
    with np.errstate(divide="ignore"):
        z = ((np.sign(rays) * half - T[:3, 3]) / rays).min(axis=-1)
    z += NOISE * z**2 * rng.standard_normal(z.shape)
    color = rng.integers(0, 256, (*z.shape, 3), dtype=np.uint8)
    return Frame(number, str(number), number / 30.0, color, z.astype(np.float32), CAMERA)


def classes_of(uv: np.ndarray, setting: Setting, rng: np.random.Generator) -> np.ndarray:
    """(P, K + 1) log probabilities: of all classes everywhere, or of some in a box each."""
    log_p = np.full((len(uv), setting.classes + 1), np.log(0.01), np.float32)
    log_p[:, -1] = np.log(0.1)
    if setting.spoken == 0:
        log_p[:, :-1] = np.log(rng.uniform(0.01, 0.9, (len(uv), setting.classes)))
        return log_p
    for _ in range(setting.spoken):
        corner = rng.integers(0, (CAMERA.width - 160, CAMERA.height - 160))
        inside = ((uv >= corner) & (uv < corner + 160)).all(axis=1)
        log_p[inside, rng.integers(setting.classes)] = np.log(0.8)
    return log_p


def describe(measured: Sequence[Measured]) -> str:
    """Two tables in Markdown: times, and memory."""
    times = table(
        ("setting", "points", "surface, ms", "voxels, ms", "voxels, mean ms", "assembling, s", "ln p off by, nats"),
        [
            (
                m.name,
                f"{m.points:,}",
                f"{m.surface_ms:.1f}",
                f"{m.add_ms:.1f}",
                f"{m.add_mean_ms:.1f}",
                f"{m.assemble_s:.2f}",
                f"{m.error:.2f}",
            )
            for m in measured
        ],
    )
    memory = table(
        (
            "setting",
            "voxels of the world",
            "of submaps",
            "submaps (on disk)",
            "bytes a voxel, growing / finished",
            "arrays, MB",
            "bound, MB",
            "process grew by, MB",
        ),
        [
            (
                m.name,
                f"{m.world_voxels:,}",
                f"{m.held_voxels:,}",
                f"{m.submaps} ({m.spilled})",
                f"{m.row_bytes:.0f} / {m.frozen_bytes:.0f}",
                f"{m.arrays_mb:.0f}",
                f"{m.bound_mb:.0f}",
                f"{m.peak_mb:.0f}",
            )
            for m in measured
        ],
    )
    return (
        f"Voxels of 1 cm, 640 x 480, every {VoxelConfig().pixel_step}rd pixel of every such row. Medians a frame; the "
        f"limit for six classes is {LIMIT_MS:.0f} ms beyond the detector.\n\n{times}\n\n{memory}"
    )


if __name__ == "__main__":
    sys.exit(main())
