"""What a run wrote beside its map, as far as questions about views need it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np

from ...factors.evidence_model import EvidenceModel, default_evidence_model
from ..config import BeliefConfig, MapperConfig
from ..config_file import load_config
from ..evidence_choice import evidence_model
from ..map.store import OutputFolder
from ..map.views_file import StoredViews
from .map_content import MapContent

MAP_FILE = "map.json"  # a map under another name may lie beside the files of any run


class RunFiles:
    """The files of the run that made a map; without a folder, what is known without one.

    Args:
        content: the map.
    """

    def __init__(self, content: MapContent) -> None:
        self._content = content
        folder = _folder_of(content)
        self._out = None if folder is None else OutputFolder(folder)
        file = None if self._out is None else self._out.config_file
        self._config = MapperConfig() if file is None or not file.is_file() else _read_config(file, _mark(file))

    @property
    def spacing(self) -> float:
        """Metres between neighbouring points of the cloud."""
        return self._config.cloud.voxel_size

    @property
    def beliefs(self) -> BeliefConfig:
        """Which views of a thing are independent."""
        return self._config.beliefs

    def model(self) -> EvidenceModel:
        """What is known of the detector that the map was made with, for the map's classes.

        Raises:
            InputError: the model that the run's configuration names is missing or damaged.
        """
        name = self._config.evidence.model
        chosen = (evidence_model(name) if name else None) or default_evidence_model(self._content.classes)
        return chosen.bind(self._content.classes)

    def cloud(self) -> np.ndarray:
        """(M, 3) float32 metres, map frame; no points where the map has no cloud.

        Raises:
            InputError: the cloud is damaged.
        """
        file = self._content.cloud
        if file is None:
            return np.empty((0, 3), dtype=np.float32)
        return _read_points(file, _mark(file))

    def coarse_cloud(self) -> np.ndarray:
        """(M, 3) the same, of about every second point along each axis: enough to keep clear of."""
        file = self._content.cloud
        return self.cloud() if file is None else _read_coarsely(file, _mark(file), 2.0 * self.spacing)

    def trajectory(self) -> tuple[np.ndarray, np.ndarray]:
        """(N,) seconds and (N, 4, 4) `T_world_camera`; none where the run left no trajectory beside the map.

        Raises:
            InputError: the trajectory is damaged.
        """
        if self._out is None or not self._out.trajectory_file.is_file():
            return np.empty(0), np.empty((0, 4, 4))
        return self._out.read_trajectory()


def class_posteriors(content: MapContent) -> np.ndarray:
    """(N, K) class probabilities of the things, given that they exist, in the order of the map's classes."""
    return np.array([[t.class_posterior.get(name, 0.0) for name in content.classes] for t in content.things]).reshape(
        len(content.things), len(content.classes)
    )


def nearest_in_time(stamps: np.ndarray, wanted: Sequence[float]) -> np.ndarray:
    """(M,) places of the nearest of (N,) growing stamps, N > 0."""
    times = np.asarray(wanted, dtype=float)
    after = np.clip(np.searchsorted(stamps, times), 1, max(len(stamps) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(stamps) - 1)
    return np.where(np.abs(stamps[after] - times) < np.abs(stamps[before] - times), after, before)


def _folder_of(content: MapContent) -> Path | None:
    """The run's folder: that of the cloud, or of the file that the things' views are read from."""
    if content.cloud is not None:
        return content.cloud.parent
    stored = next((thing.views for thing in content.things if isinstance(thing.views, StoredViews)), None)
    if stored is None or stored.file.map_file.name != MAP_FILE:
        return None
    return stored.file.map_file.parent


def _mark(file: Path) -> tuple[int, int] | None:
    """Changes when the file does: a map is asked again and again, its files are read once."""
    status = file.stat() if file.is_file() else None
    return status and (status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=2)
def _read_config(file: Path, mark: tuple[int, int] | None) -> MapperConfig:
    return load_config(file, MapperConfig)


@lru_cache(maxsize=2)
def _read_points(file: Path, mark: tuple[int, int] | None) -> np.ndarray:
    from ..map.cloud_file import read_cloud

    points = np.ascontiguousarray(read_cloud(file)[0], dtype=np.float32)
    points.setflags(write=False)
    return points


@lru_cache(maxsize=2)
def _read_coarsely(file: Path, mark: tuple[int, int] | None, spacing: float) -> np.ndarray:
    """The first point of every voxel of this size."""
    points = _read_points(file, mark)
    voxel = np.floor(points / spacing).astype(np.int64)
    voxel -= voxel.min(axis=0, initial=0)
    wide, high, _ = voxel.max(axis=0, initial=0) + 1
    _, first = np.unique(voxel @ np.array([1, wide, wide * high]), return_index=True)
    return points[first]
