"""The output folder of a run, read for the evaluator.

map.json  trajectory.txt  report.json    as `thingmap run` writes them
cloud.ply                                the cloud, read when it is asked for
labels.ply                               optional, takes the place of cloud.ply: a cloud with labels (see `read_labels`)
snapshots/index.json  snapshots/*.json   optional, maps on the way (`thingmap run --snapshots`)
keyframes.npz                            optional, stamps (M,), T_world_camera (M, 4, 4) and covariance (M, 6, 6)
"""

from __future__ import annotations

import json
from functools import cache
from itertools import pairwise
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from ....datasets.errors import InputError
from ....datasets.json_record import JsonRecord
from ....datasets.poses import nearest_rotations, read_tum_poses
from ...map.labels_file import read_labels
from ...map.object_map import ObjectMap
from ...map.store import AGAIN, OutputFolder
from ..result import NotEvaluated
from .case import KeyframePoses, MappedRun, Snapshot

SNAPSHOT_INDEX = "index.json"
SNAPSHOT_SCHEMA = "thingmap-snapshots/1"
STAMP_ROUNDING = 1e-5  # s; files of trajectories hold microseconds
SYMMETRY = 1e-6  # of a covariance, relative to its largest value


def load_run(out: str | Path) -> MappedRun:
    """Everything that the evaluator reads of a run.

    Raises:
        InputError: the folder holds no map, or one of its files is not what it should be.
    """
    folder = OutputFolder.open(out)
    object_map = folder.read_map(edits=False)  # what was estimated is judged, not what somebody corrected
    trajectory = read_tum_poses(folder.trajectory_file)
    if len(trajectory.stamps) == 0:
        raise InputError(folder.trajectory_file, "the pose of a frame", "none", AGAIN)
    report = folder.read_report()
    if not isinstance(report, dict):
        raise InputError(folder.report_file, "a report in JSON", type(report).__name__, AGAIN)
    return MappedRun(
        folder=folder.path,
        object_map=object_map,
        stamps=trajectory.stamps,
        poses=trajectory.matrices,
        report=report,
        snapshots=_read_snapshots(folder.snapshot_folder, trajectory.stamps),
        keyframes=_read_keyframes(folder.keyframes_file) if folder.keyframes_file.is_file() else None,
        cloud=cache(lambda: _read_cloud(folder, object_map)),
    )


def _read_snapshots(folder: Path, stamps: np.ndarray) -> tuple[Snapshot, ...]:
    """By growing number of frames; none where there is no index. The run has mapped frames at these (N,) `stamps`."""
    index = folder / SNAPSHOT_INDEX
    if not index.is_file():
        return ()
    try:
        root = JsonRecord(json.loads(index.read_text(encoding="utf-8")), index, AGAIN)
    except (OSError, ValueError) as error:
        raise InputError(index, "an index of snapshots in JSON", str(error), AGAIN) from None
    if root.text("schema") != SNAPSHOT_SCHEMA:
        remedy = "open it with the version of thingmap that wrote it"
        raise InputError(index, f'the schema "{SNAPSHOT_SCHEMA}"', repr(root.text("schema")), remedy)
    snapshots = sorted((_read_snapshot(index, r) for r in root.records("snapshots")), key=lambda s: s.frames)
    for one, other in pairwise(snapshots):
        if one.frames == other.frames:
            raise InputError(index, "one snapshot for a number of frames", f"two after {one.frames} frames", AGAIN)
    for one in snapshots:
        if not (0 < one.frames <= len(stamps) and abs(stamps[one.frames - 1] - one.stamp) <= STAMP_ROUNDING):
            found = f"one after {one.frames} frames at {one.stamp:.6f} s"
            raise InputError(index, f"snapshots of the {len(stamps)} frames of trajectory.txt", found, AGAIN)
    return tuple(snapshots)


def _read_snapshot(index: Path, record: JsonRecord) -> Snapshot:
    name = record.text("file")
    if Path(name).name != name:
        raise InputError(index, "names of files beside it", repr(name), AGAIN)
    pose = _valid_poses(index, f"snapshot {name}", record.array("T_world_camera", (4, 4))[None])[0]
    return Snapshot(record.count("frames"), record.number("stamp"), pose, ObjectMap.load(index.parent / name))


def _read_keyframes(file: Path) -> KeyframePoses:
    try:
        with np.load(file, allow_pickle=False) as content:
            names = ("stamps", "T_world_camera", "covariance")
            stamps, poses, covariances = (np.asarray(content[name], dtype=np.float64) for name in names)
    except KeyError as error:
        raise InputError(file, "arrays stamps, T_world_camera and covariance", str(error), AGAIN) from None
    except (OSError, ValueError, TypeError, EOFError, AttributeError, BadZipFile) as error:
        raise InputError(file, "keyframes as an .npz archive", str(error), AGAIN) from None
    count, shapes = len(np.atleast_1d(stamps)), (stamps.shape, poses.shape, covariances.shape)
    if shapes != ((count,), (count, 4, 4), (count, 6, 6)):
        raise InputError(file, "shapes (M,), (M, 4, 4) and (M, 6, 6)", ", ".join(map(str, shapes)), AGAIN)
    if not np.isfinite(stamps).all():
        raise InputError(file, "finite stamps", "others", AGAIN)
    for k, covariance in enumerate(covariances):
        if not _is_covariance(covariance):
            found = f"something else for keyframe {k}"
            raise InputError(file, "symmetric covariances without negative eigenvalue", found, AGAIN)
    return KeyframePoses(stamps, _valid_poses(file, "keyframe {}", poses), covariances)


def _valid_poses(file: Path, what: str, poses: np.ndarray) -> np.ndarray:
    """(N, 4, 4) poses with exact rotations; `what` names one in errors."""
    valid, problems = nearest_rotations(poses)
    for row, problem in problems.items():
        raise InputError(file, "poses as 4 x 4 matrices", f"{what.format(row)}: {problem}", AGAIN)
    return valid


def _is_covariance(matrix: np.ndarray) -> bool:
    if not np.isfinite(matrix).all():
        return False
    tolerance = SYMMETRY * np.abs(matrix).max()
    return bool(np.abs(matrix - matrix.T).max() <= tolerance and np.linalg.eigvalsh(matrix)[0] >= -tolerance)


def _read_cloud(folder: OutputFolder, object_map: ObjectMap) -> tuple[np.ndarray, np.ndarray | None]:
    if folder.labels_file.is_file():
        points, labels = read_labels(folder.labels_file, object_map.classes)
        return points, labels.label
    if not folder.cloud_file.is_file():
        raise NotEvaluated(
            f"the run has no cloud: there is neither {folder.cloud_file.name} nor {folder.labels_file.name}"
        )
    return folder.read_cloud()[0], None
