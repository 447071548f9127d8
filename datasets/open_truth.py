"""One way in for truth: whatever tells something of a scene becomes a `GroundTruth`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from .errors import InputError
from .folder_truth import FolderWithTruth
from .ground_truth import GroundTruth
from .open import LOADERS, SAMPLE_PREFIX, SYNTH_PREFIX, open_sequence
from .paths import user_path
from .poses import read_poses_at
from .recorded import RecordedSequence
from .rgbd_scenes_v1 import RgbdScenesV1
from .rgbd_scenes_v2 import RgbdScenesV2
from .sequence import Sequence
from .truth import HasPointTruth, HasTruth
from .truth_files import FOLDER, TruthPaths
from .truth_json import FILE_NAME, truth_of_known_objects
from .truth_scenes import truth_of_v1, truth_of_v1_boxes, truth_of_v2, truth_of_v2_files
from .truth_tum import CUBOIDS, truth_of_trajectory, with_cuboids

UNDERSTOOD = (
    f"a synthetic sequence ({SYNTH_PREFIX}PRESET, {SAMPLE_PREFIX}NAME, or a folder with {FOLDER}/), "
    "the folder of a sequence with poses (7-Scenes, TUM, RGB-D Scenes v2, plain), a TUM trajectory (*.txt), "
    "RGB-D Scenes boxes (v1: *.mat, *.tsv#VIDEO) or labels (v2: pc/NN.pose, .label, .ply), or objects in JSON (*.json)"
)
REMEDY = "give one of these"
TRAJECTORY = "groundtruth.txt"
Z_UP = np.array([0.0, 0.0, 1.0])  # of all rendered worlds


def open_truth(spec: str | Path, poses: Path | None = None) -> GroundTruth:
    """Opens what is known of a scene.

    Args:
        spec: a line or a path, see `UNDERSTOOD`. A file of objects in the folder of a sequence brings the poses and
            images of that sequence, and the folder brings its file of objects (`objects_derived.json`).
        poses: a trajectory in the TUM format, or anything else understood here that has poses; they take the place of
            the poses, if any, that `spec` brings. Where there are images, or truth by frame, a trajectory is
            interpolated at the frames' stamps.

    Raises:
        InputError: there is no such thing, it is none of those understood, is damaged, or tells nothing.
        UserError: a synthetic line is wrong.
    """
    truth = _open(str(spec))
    if poses is not None:
        truth = _with_poses(truth, user_path(poses))
    if truth.poses is None and not truth.objects and truth.point_truth is None:
        found = "neither poses nor objects nor labelled points"
        raise InputError(str(spec), "something that is known of the scene", found, "give its truth, or its poses")
    return truth


def _open(spec: str) -> GroundTruth:
    if spec.startswith((SAMPLE_PREFIX, SYNTH_PREFIX)):
        return _truth_of_sequence(open_sequence(spec))
    path = user_path(spec)
    if path.is_dir():
        return _truth_of_folder(path)
    table, _, video = spec.rpartition("#")
    if not path.exists() and table.endswith(".tsv"):
        return truth_of_v1_boxes(user_path(table), video)
    if not path.exists():
        raise InputError(path, UNDERSTOOD, "no such file or folder", "check the path")
    folder = path.resolve().parent  # `truth.json` alone is meant in its folder too
    if path.name == TruthPaths(folder).record.name and folder.name == FOLDER:
        return _truth_of_folder(folder.parent)
    readers = {
        ".json": _truth_of_objects,
        ".txt": truth_of_trajectory,
        ".tsv": truth_of_v1_boxes,
        ".mat": truth_of_v1_boxes,
        **dict.fromkeys((".pose", ".label", ".ply"), truth_of_v2_files),
    }
    if path.suffix not in readers:
        raise InputError(path, UNDERSTOOD, f"a file {path.suffix or 'without suffix'}", REMEDY)
    return readers[path.suffix](path)


def _truth_of_folder(path: Path) -> GroundTruth:
    """The sequence of a folder; where it holds none, the one file of truth in it."""
    if any(loader.find(path) for loader in LOADERS):
        return _truth_of_sequence(open_sequence(path))
    for name, reader in ((FILE_NAME, truth_of_known_objects), (TRAJECTORY, truth_of_trajectory)):
        if (path / name).is_file():
            return reader(path / name)
    names = sorted(entry.name for entry in path.iterdir())
    found = ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
    raise InputError(path, UNDERSTOOD, found or "an empty folder", REMEDY)


def _truth_of_sequence(sequence: Sequence) -> GroundTruth:
    """Everything that a sequence and the files beside its images tell."""
    if isinstance(sequence, HasTruth):
        return replace(
            _bare(sequence),
            classes=sequence.classes,
            objects=sequence.objects,
            complete=True,
            up=sequence.up if isinstance(sequence, FolderWithTruth) else Z_UP,
            frame_truth=sequence.truth,
            point_truth=sequence.point_truth if isinstance(sequence, HasPointTruth) else None,
        )
    if isinstance(sequence, RgbdScenesV1):
        return truth_of_v1(sequence)
    if isinstance(sequence, RgbdScenesV2):
        return truth_of_v2(sequence)
    truth = _bare(sequence)
    if isinstance(sequence, RecordedSequence):
        if (sequence.path / CUBOIDS).is_file():
            return with_cuboids(truth, sequence.path / CUBOIDS)
        if (sequence.path / FILE_NAME).is_file():
            return _objects_of(truth, truth_of_known_objects(sequence.path / FILE_NAME))
    return truth


def _truth_of_objects(path: Path) -> GroundTruth:
    """Objects in JSON, with the sequence in whose folder the file lies."""
    objects, folder = truth_of_known_objects(path), path.resolve().parent
    if any(loader.find(folder) == [folder] for loader in LOADERS):
        return _objects_of(_bare(open_sequence(folder)), objects)
    return objects


def _objects_of(frames: GroundTruth, objects: GroundTruth) -> GroundTruth:
    """The frames of one truth and the objects of the other."""
    return replace(
        objects,
        name=frames.name or objects.name,
        up=frames.up,
        intrinsics=frames.intrinsics,
        names=frames.names,
        stamps=frames.stamps,
        poses=frames.poses,
        sequence=frames.sequence,
    )


def _bare(sequence: Sequence) -> GroundTruth:
    """Frames, poses and the direction of gravity of a sequence."""
    return GroundTruth(
        name=sequence.name,
        classes=(),
        complete=False,
        up=None if sequence.gravity is None else -np.asarray(sequence.gravity, dtype=np.float64),
        intrinsics=sequence.intrinsics,
        names=tuple(sequence.names),
        stamps=sequence.stamps,
        poses=sequence.poses,
        sequence=sequence,
    )


def _with_poses(truth: GroundTruth, path: Path) -> GroundTruth:
    given = _open(str(path))
    if given.poses is None:
        raise InputError(path, "poses of the frames", "none", "give a trajectory, or the folder of a sequence with one")
    # `frame_truth` counts by the frames of `truth`: under those of the poses it would tell of other images.
    own_frames = truth.sequence is not None or truth.frame_truth is not None
    if own_frames and path.is_file() and path.suffix == ".txt":
        return replace(truth, poses=read_poses_at(path, truth.stamps))
    if own_frames and len(given.poses) != len(truth.names):
        found = f"{len(given.poses)} poses"
        raise InputError(
            path, f"a pose for each of the {len(truth.names)} frames", found, "give poses of this sequence"
        )
    if own_frames:
        return replace(truth, poses=given.poses)
    up = truth.up if truth.up is not None else given.up
    return replace(_objects_of(given, truth), name=truth.name, up=up, intrinsics=truth.intrinsics or given.intrinsics)
