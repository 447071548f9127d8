"""The output folder of a run: its files, and the promise never to clear one."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...datasets.errors import InputError, UserError
from ..edits.journal import journal_path
from .appearance import embeddings_path
from .atomic import make_folder, replacing, write_atomic
from .cloud_file import AGAIN, read_cloud, write_cloud
from .map_file import CLOUD_NAME
from .map_file import FILE_NAME as MAP_FILE
from .object_map import ObjectMap
from .trajectory_file import read_trajectory, write_trajectory
from .views_file import evidence_path

__all__ = ["AGAIN", "OutputFolder"]


@dataclass(frozen=True, slots=True)
class OutputFolder:
    """A folder that holds one mapped sequence. Every file is written whole or not at all; nothing is ever deleted."""

    path: Path

    @staticmethod
    def check(path: str | Path, overwrite: bool = False) -> None:
        """Raise `UserError` where `create` would refuse the path; nothing is made."""
        path = Path(path)
        if path.exists() and not path.is_dir():
            raise InputError(path, "a folder to write to", "a file", "choose another folder")
        if path.is_dir() and not overwrite and any(path.iterdir()):
            raise UserError(f"{path}: the folder is not empty; choose another one, or replace its map with --overwrite")

    @classmethod
    def create(cls, path: str | Path, overwrite: bool = False) -> OutputFolder:
        """A folder to write to, made with its parents where absent.

        Raises:
            UserError: it is a file or cannot be made; it holds something and `overwrite` is not set. With `overwrite`
                the files of a run are replaced one by one and everything else stays.
        """
        cls.check(path, overwrite)
        make_folder(Path(path))
        return cls(Path(path))

    @classmethod
    def open(cls, path: str | Path) -> OutputFolder:
        """A folder to read from; raises `InputError` where it holds no map."""
        path = Path(path)
        if not (path / MAP_FILE).is_file():
            found = "a file" if path.is_file() else f"no {MAP_FILE} in it" if path.is_dir() else "nothing"
            raise InputError(path, "the output folder of a run", found, "give the folder that `thingmap run` wrote")
        return cls(path)

    @property
    def map_file(self) -> Path:
        """`ObjectMap.load` reads it."""
        return self.path / MAP_FILE

    @property
    def evidence_file(self) -> Path:
        """What every view said about every thing; `Thing.explain` reads it."""
        return evidence_path(self.map_file)

    @property
    def embeddings_file(self) -> Path:
        """How things look, where the detector gave embeddings; `Thing.embedding` reads it."""
        return embeddings_path(self.map_file)

    @property
    def journal_file(self) -> Path:
        """What people changed in the map; `MapEditor` writes it, `ObjectMap.load` does it."""
        return journal_path(self.map_file)

    @property
    def trajectory_file(self) -> Path:
        """TUM format, a line for every frame that was mapped."""
        return self.path / "trajectory.txt"

    @property
    def config_file(self) -> Path:
        """The configuration as it was used, with every default."""
        return self.path / "config.yaml"

    @property
    def report_file(self) -> Path:
        """What happened: frames, times, outcomes."""
        return self.path / "report.json"

    @property
    def cloud_file(self) -> Path:
        """Coloured points, map frame, metres."""
        return self.path / CLOUD_NAME

    @property
    def labels_file(self) -> Path:
        """The cloud with a class for every point, where the mapper labels points."""
        return self.path / "labels.ply"

    @property
    def voxels_file(self) -> Path:
        """What `thingmap label` has gathered, to go on from."""
        return self.path / "voxels.npz"

    @property
    def ledger_file(self) -> Path:
        """The mapper's measurements, from which its graph can be rebuilt."""
        return self.path / "ledger.npz"

    @property
    def keyframes_file(self) -> Path:
        """Poses of the keyframes with their covariances."""
        return self.path / "keyframes.npz"

    @property
    def snapshot_folder(self) -> Path:
        """Maps on the way, where they were asked for."""
        return self.path / "snapshots"

    def write_map(self, object_map: ObjectMap, include_doubtful: bool = False) -> None:
        """The map as it was estimated and the evidence of its things.

        Where people have edited the map that was here before, the journal stays, and things keep the ids that they
        had: see `edits/remapping.py`.
        """
        if self.journal_file.exists():
            from ..edits.remapping import with_kept_ids

            object_map = with_kept_ids(object_map, self.map_file, include_doubtful)
        object_map.save(self.map_file, include_doubtful)

    def write_trajectory(self, stamps: np.ndarray, T_world_camera: np.ndarray) -> None:
        """(N,) seconds and (N, 4, 4) poses as TUM lines `stamp tx ty tz qx qy qz qw`."""
        write_trajectory(self.trajectory_file, stamps, T_world_camera)

    def write_cloud(self, points: np.ndarray, colors: np.ndarray) -> None:
        """(M, 3) metres and (M, 3) uint8 RGB as binary PLY."""
        write_cloud(self.cloud_file, points, colors)

    def set_labels_aside(self) -> None:
        """Labels of an earlier run, which are not this map's, get another name."""
        if self.labels_file.exists():
            self.labels_file.replace(self.labels_file.with_name("labels.earlier.ply"))

    def write_keyframes(self, stamps: np.ndarray, T_world_camera: np.ndarray, covariance: np.ndarray) -> None:
        """(M,) seconds, (M, 4, 4) poses, (M, 6, 6) covariances in the pose's right tangent [rad, m], as an .npz."""
        with replacing(self.keyframes_file) as temporary, temporary.open("wb") as file:
            np.savez(file, stamps=stamps, T_world_camera=T_world_camera, covariance=covariance)

    def write_config(self, text: str) -> None:
        write_atomic(self.config_file, text.encode())

    def write_report(self, report: dict[str, Any]) -> None:
        """Values as JSON; a number that is not finite, which JSON cannot hold, becomes null."""
        text = json.dumps(_plain(report), indent=1, ensure_ascii=False, allow_nan=False, default=str)
        write_atomic(self.report_file, f"{text}\n".encode())

    def read_map(self, *, edits: bool = True) -> ObjectMap:
        """The map, with people's edits or as it was estimated; raises `InputError` as `ObjectMap.load`."""
        return ObjectMap.load(self.map_file, edits=edits)

    def read_trajectory(self) -> tuple[np.ndarray, np.ndarray]:
        """(N,) stamps in seconds and (N, 4, 4) `T_world_camera`; raises `InputError` where there are none."""
        return read_trajectory(self.trajectory_file)

    def read_cloud(self) -> tuple[np.ndarray, np.ndarray]:
        """(M, 3) float64 metres and (M, 3) uint8 RGB; raises `InputError` where the file is absent or damaged."""
        return read_cloud(self.cloud_file)

    def read_report(self) -> dict[str, Any]:
        try:
            return json.loads(self.report_file.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise InputError(self.report_file, "a report in JSON", str(error), AGAIN) from None


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    if isinstance(value, np.generic | np.ndarray):
        return _plain(value.tolist())
    return None if isinstance(value, float) and not np.isfinite(value) else value
