"""Where memory goes: the process as a whole, and the parts of a mapper that can be told apart from Python."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import numpy as np

from thingmap.mapper.mapper import SemanticMapper

_STATM = Path("/proc/self/statm")
MB = 1e6


def resident_mb() -> float | None:
    """Memory of this process now, MB (10^6 bytes); None where the system has no /proc."""
    if not _STATM.exists():
        return None
    import resource

    return int(_STATM.read_text().split()[1]) * resource.getpagesize() / MB


def deep_size(thing: object) -> int:
    """Bytes of a Python object and all that it refers to, arrays included, each counted once.

    What lives behind a C++ wrapper (GTSAM's factors, KISS-ICP's map) is not seen.
    """
    seen: set[int] = set()
    total, left = 0, [thing]
    while left:
        item = left.pop()
        if id(item) in seen or isinstance(item, type | ModuleType | FunctionType):
            continue
        seen.add(id(item))
        total += sys.getsizeof(item)
        left.extend(_inside(item))
    return total


def _inside(item: object) -> Iterable[object]:
    if isinstance(item, np.ndarray):
        return [] if item.base is None else [item.base]  # getsizeof counts the data of an array that owns it
    if isinstance(item, str | bytes | int | float | complex | None.__class__):
        return []
    if isinstance(item, Mapping):
        return [*item.keys(), *item.values()]
    slots = [getattr(item, name, None) for cls in type(item).__mro__ for name in _slots(cls)]
    inside = [*slots, *vars(item).values()] if hasattr(item, "__dict__") else slots
    if isinstance(item, Iterable) and hasattr(item, "__len__"):
        inside = [*inside, *item]
    return inside


def _slots(cls: type) -> tuple[str, ...]:
    slots = cls.__dict__.get("__slots__", ())
    return (slots,) if isinstance(slots, str) else tuple(slots)


@dataclass(frozen=True, slots=True)
class MapperSizes:
    """What a mapper holds: MB of its parts, and counts.

    `graph_and_rest` is what is resident beyond the other parts: ISAM2, its factors, the libraries, the allocator.
    """

    ledger_mb: float
    cloud_mb: float
    landmarks_and_tracks_mb: float
    trajectory_mb: float
    local_map_mb: float
    graph_and_rest_mb: float
    keyframes: int
    landmarks: int
    candidates: int
    cloud_points: int
    local_map_points: int
    ledger_records: int

    @property
    def total_mb(self) -> float:
        """Resident."""
        return sum(getattr(self, field.name) for field in fields(self) if field.name.endswith("_mb"))


def measure_mapper(mapper: SemanticMapper) -> MapperSizes:
    """Look into a mapper; its parts are private, as nobody else has a use for them."""
    camera, scene, statistics = mapper._camera, mapper._scene, mapper.statistics()
    local_map = _local_map(camera._odometry)
    cloud_points, _ = mapper.cloud()
    parts = {
        "ledger_mb": deep_size(camera.smoother.ledger) / MB,
        "cloud_mb": deep_size(mapper._cloud) / MB,
        "landmarks_and_tracks_mb": deep_size([scene.landmarks, scene.retired, scene.tracks]) / MB,
        "trajectory_mb": deep_size(camera._frames) / MB,
        "local_map_mb": local_map.nbytes / MB,
    }
    return MapperSizes(
        **parts,
        graph_and_rest_mb=(resident_mb() or np.nan) - sum(parts.values()),
        keyframes=statistics["keyframes"],
        landmarks=statistics["landmarks"],
        candidates=statistics["candidates"],
        cloud_points=len(cloud_points),
        local_map_points=len(local_map),
        ledger_records=statistics["ledger_records"],
    )


def _local_map(odometry: Any) -> np.ndarray:
    """(N, 3) points of KISS-ICP's map; none where poses are given."""
    icp = getattr(odometry, "_icp", None)
    return np.empty((0, 3)) if icp is None else icp.local_map.point_cloud()
