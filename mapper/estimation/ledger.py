"""The append-only list of measurements from which the graph can be rebuilt.

It is the saved session, the journal and the crash recovery in one: GTSAM's custom factors and ISAM2 do not serialise,
measurements do.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterator
from dataclasses import MISSING, Field, dataclass, field, fields
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from ...datasets.errors import InputError

SCHEMA = "thingmap-ledger/4"
# 1 knew no parts: what has a default since is filled with it; 2 knew no loop closures; 3 took no measurement back
_READABLE = ("thingmap-ledger/1", "thingmap-ledger/2", "thingmap-ledger/3", SCHEMA)


@dataclass(frozen=True, slots=True, eq=False)
class Gauge:
    """Where the first keyframe is: (4, 4) `T_world_camera` and its sigmas (rad, m)."""

    T_world_camera: np.ndarray
    sigmas: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Odometry between keyframes `a` and `b`: (4, 4) `T_a_b` and its (6, 6) covariance."""

    a: int
    b: int
    T_a_b: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Visual:
    """Motion between keyframes `a` and `b` from image features: (4, 4) `T_a_b`, (6, 6) covariance."""

    a: int
    b: int
    T_a_b: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Loop:
    """Loop closure: keyframe `b` as seen from an earlier `a`: (4, 4) `T_a_b`, (6, 6) covariance."""

    a: int
    b: int
    T_a_b: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class DropLoop:
    """The `Loop` (or `Visual`) of this number in the ledger was found wrong: it leaves the graph."""

    record: int


@dataclass(frozen=True, slots=True, eq=False)
class ScanMatch:
    """Motion between keyframes `a` and `b` from their depth: (4, 4) `T_a_b`, (6, 6) covariance."""

    a: int
    b: int
    T_a_b: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class UpPrior:
    """What is known of the world's up direction beforehand: (3,) unit vector, world axes; sigma in rad."""

    direction: np.ndarray
    sigma: float


@dataclass(frozen=True, slots=True, eq=False)
class Up:
    """Up as measured in one keyframe: (3,) unit vector, camera axes; sigma in rad."""

    keyframe: int
    direction: np.ndarray
    sigma: float


@dataclass(frozen=True, slots=True, eq=False)
class NewLandmark:
    """A landmark enters the graph: (3,) position, world, metres; (3,) log half-axes."""

    landmark: int
    position: np.ndarray
    log_size: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class DepthCentre:
    """Object centre from depth: (3,) camera frame, metres; sigmas across and along the ray, metres."""

    keyframe: int
    landmark: int
    centre: np.ndarray
    sigma_tangential: float
    sigma_range: float
    visibility: float


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """Detection box (4,) pixels; (4,) bool, sides that are not cut off by the image border; sigma in pixels.

    `part` is the `VolumePart` that the box shows.
    """

    keyframe: int
    landmark: int
    xyxy: np.ndarray
    sides_seen: np.ndarray
    sigma_px: float
    part: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """What one keyframe by itself said about a landmark: hits, misses, log likelihood of the free ratio (nats).

    `visible` (5,) is the share of every `VolumePart` that was seen, `depth` the mean log ratio of the depth likelihood
    (nats); `free` and `depth` are times `seen`, the share of the volume that depth told of. How new the view was is
    known from the poses.
    """

    keyframe: int
    landmark: int
    hits: float
    misses: float
    free: float
    visible: np.ndarray = field(default_factory=lambda: np.ones(5, dtype=np.float32))
    depth: float = 0.0
    seen: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Scores:
    """Detector scores (K,) of a landmark's `VolumePart`, the part's occlusion then, and the view's weight."""

    keyframe: int
    landmark: int
    scores: np.ndarray
    occlusion: float
    weight: float
    part: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Site:
    """The Gaussian stand-in for the class mixture on a landmark's size: (3,) mean, (3, 3) information."""

    landmark: int
    mean: np.ndarray
    information: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Merge:
    """`absorbed` turned out to be `kept`: its measurements count for `kept` from now on."""

    kept: int
    absorbed: int


@dataclass(frozen=True, slots=True, eq=False)
class Retire:
    """The landmark is no object: its measurements leave the graph."""

    landmark: int


@dataclass(frozen=True, slots=True, eq=False)
class DropMeasurement:
    """The `DepthCentre`, `Box`, `Look` or `Scores` of this number was of something else: it leaves the graph."""

    record: int


@dataclass(frozen=True, slots=True, eq=False)
class Revive:
    """A retired landmark was there all along: its measurements come back. (3,) position and log half-axes to start."""

    landmark: int
    position: np.ndarray
    log_size: np.ndarray


Record = (
    Gauge
    | Motion
    | Visual
    | ScanMatch
    | Loop
    | DropLoop
    | UpPrior
    | Up
    | NewLandmark
    | DepthCentre
    | Box
    | Look
    | Scores
    | Site
    | Merge
    | Retire
    | DropMeasurement
    | Revive
)
KINDS: tuple[type, ...] = (
    Gauge, Motion, Visual, ScanMatch, Loop, DropLoop, UpPrior, Up,
    NewLandmark, DepthCentre, Box, Look, Scores, Site, Merge, Retire, DropMeasurement, Revive,
)  # fmt: skip
Link = Motion | Visual | ScanMatch | Loop  # between two keyframes


class Ledger:
    """Records in the order in which they were made."""

    def __init__(self) -> None:
        self._records: list[Record] = []

    def append(self, record: Record) -> int:
        """Adds a record; returns its number."""
        self._records.append(record)
        return len(self._records) - 1

    def __len__(self) -> int:
        return len(self._records)

    def __getitem__(self, index: int) -> Record:
        return self._records[index]

    def __iter__(self) -> Iterator[Record]:
        return iter(self._records)

    def save(self, path: Path, meta: dict | None = None) -> None:
        """Writes one array per kind and field (`.npz`), with the records' numbers, and `meta` as JSON."""
        arrays: dict[str, np.ndarray] = {"meta": np.array(json.dumps({"schema": SCHEMA, **(meta or {})}))}
        for kind in KINDS:
            numbered = [(i, r) for i, r in enumerate(self._records) if type(r) is kind]
            if not numbered:
                continue
            arrays[f"{kind.__name__}/number"] = np.array([i for i, _ in numbered])
            for f in fields(kind):
                arrays[f"{kind.__name__}/{f.name}"] = np.stack([np.asarray(getattr(r, f.name)) for _, r in numbered])
        with path.open("wb") as file:
            np.savez_compressed(file, **arrays)  # type: ignore[arg-type]

    @classmethod
    def load(cls, path: Path) -> tuple[Ledger, dict]:
        """The ledger and its `meta`.

        Raises:
            InputError: where the file is not a ledger.
        """
        try:
            with np.load(path, allow_pickle=False) as file:
                arrays = {name: file[name] for name in file.files}
            meta = json.loads(str(arrays.pop("meta")))
            if meta["schema"] not in _READABLE:
                raise ValueError(f"schema {meta['schema']!r} instead of {SCHEMA!r}")
            records = _records(arrays)
        # a damaged archive fails in NumPy, zipfile, zlib or here, in many ways
        except (OSError, EOFError, ValueError, LookupError, TypeError, AttributeError, BadZipFile, zlib.error) as error:
            found = str(error) or type(error).__name__
            raise InputError(path, "a ledger (.npz)", found, "give the ledger.npz of a run, or map again") from None
        ledger = cls()
        ledger._records = records
        return ledger, meta


def _records(arrays: dict[str, np.ndarray]) -> list[Record]:
    """Records from one array per kind and field, in the order of their numbers."""
    numbered: list[tuple[int, Record]] = []
    for kind in KINDS:
        numbers = arrays.get(f"{kind.__name__}/number", np.empty(0, dtype=int))
        written = [f for f in fields(kind) if len(numbers) and not _is_left_out(arrays, kind, f)]
        columns = [_column(arrays[f"{kind.__name__}/{f.name}"], f.type) for f in written]
        for number, *row in zip(numbers, *columns, strict=True):
            numbered.append((int(number), kind(**{f.name: v for f, v in zip(written, row, strict=True)})))
    return [record for _, record in sorted(numbered, key=lambda item: item[0])]


def _is_left_out(arrays: dict[str, np.ndarray], kind: type, column: Field) -> bool:
    """Whether a column that was added later, and has a default since, is not in the file."""
    has_default = column.default is not MISSING or column.default_factory is not MISSING
    return has_default and f"{kind.__name__}/{column.name}" not in arrays


def _column(values: np.ndarray, kind: object) -> list:
    """Rows as arrays, or as plain numbers where the field is one."""
    return list(values) if kind == "np.ndarray" else values.tolist()
