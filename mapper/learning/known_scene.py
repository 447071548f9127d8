"""A sequence whose objects are known in space: what there is to learn from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...datasets.errors import UserError
from ...datasets.folder_truth import FolderWithTruth
from ...datasets.frame import Frame
from ...datasets.ground_truth import GroundTruth
from ...datasets.open import open_sequence
from ...datasets.open_truth import Z_UP, open_truth
from ...datasets.sequence import Sequence
from ...datasets.truth import FrameTruth, HasTruth, TrueObject
from ...detectors.simulated_spots import whole_of
from ..evaluation.things.errors import extents_along
from ..map.upright import upright_rotation


@dataclass(frozen=True, slots=True, eq=False)
class KnownScene:
    """A sequence with its objects; only those whose place and size somebody measured.

    Attributes:
        name: for people.
        sequence: frames to look at.
        objects: M objects.
        centers, log_half_axes: (M, 3) metres, world, and log of metres along the upright axes: their volumes as the
            mapper has them, which does not turn boxes.
        R_world_upright: (3, 3).
        complete: whether a detection that shows none of them is a false one.
        unmeasured: labels of annotated objects that are left out, because their place or size is unknown.
        truth: of all frames; and
        index: its index by name of the frame.
    """

    name: str
    sequence: Sequence
    objects: tuple[TrueObject, ...]
    centers: np.ndarray
    log_half_axes: np.ndarray
    R_world_upright: np.ndarray
    complete: bool
    unmeasured: tuple[str, ...]
    truth: GroundTruth
    index: Mapping[str, int]

    def pose(self, frame: Frame) -> np.ndarray | None:
        """(4, 4) `T_world_camera` in the world of the objects, or None."""
        index = self.index.get(frame.name)
        if self.truth.poses is not None and index is not None and np.isfinite(self.truth.poses[index]).all():
            return self.truth.poses[index]
        return frame.T_world_camera

    def frame_truth(self, frame: Frame) -> FrameTruth | None:
        """What can be seen in the frame, where somebody knows."""
        index = self.index.get(frame.name)
        return None if self.truth.frame_truth is None or index is None else self.truth.frame_truth(index)


def open_known_scene(
    spec: str, truth: str | None = None, dataset: str | None = None, stride: int = 1, max_frames: int | None = None
) -> KnownScene:
    """Opens a sequence with its objects.

    Args:
        spec, dataset, stride, max_frames: as `open_sequence` reads them.
        truth: as `open_truth` reads it; None for a sequence that knows its own.

    Raises:
        InputError: one of them is not what it should be.
        UserError: no object has a known place and size, no frame a known pose, or nobody knows which way is up.
    """
    sequence = open_sequence(spec, dataset=dataset, stride=stride, max_frames=max_frames)
    if truth is None:
        known = _own_truth(sequence) if isinstance(sequence, HasTruth) else open_truth(spec)
    else:
        known = open_truth(truth)
    return known_scene(sequence, known, spec if truth is None else truth)


def known_scene(sequence: Sequence, known: GroundTruth, said_by: str) -> KnownScene:
    """A sequence and what is known of it; `said_by` names the truth in errors, those of `open_known_scene`."""
    if sequence.poses is None and known.poses is None:
        raise UserError(f"{said_by}: no camera poses are known; learning needs true ones, and {sequence.name} has none")
    measured = [thing for thing in known.objects if np.isfinite([*thing.position, *thing.size]).all()]
    if not measured:
        found = f"{len(known.objects)} objects without it" if known.objects else "no objects"
        raise UserError(
            f"{said_by}: expected objects whose place and size are known, found {found}; "
            "give the truth of the objects with --truth, once for each sequence"
        )
    if known.up is None:
        raise UserError(
            f"{said_by}: nobody says which way is up, along which objects are measured; "
            'say it in the intrinsics.json of a plain folder, as "gravity": [0, 0, -1]'
        )
    half = np.array([extents_along(thing.size, thing.yaw) / 2.0 for thing in measured])
    unmeasured = tuple(thing.label for thing in known.objects if thing not in measured)
    return KnownScene(
        name=sequence.name,
        sequence=sequence,
        objects=tuple(measured),
        centers=np.array([thing.position for thing in measured], dtype=np.float64),
        log_half_axes=np.log(half),
        R_world_upright=upright_rotation(known.up),
        complete=known.complete and not unmeasured,
        unmeasured=unmeasured,
        truth=known,
        index={name: index for index, name in enumerate(known.names)},
    )


def _own_truth(sequence: Sequence) -> GroundTruth:
    assert isinstance(sequence, HasTruth)
    whole, gravity = whole_of(sequence), sequence.gravity
    up = Z_UP if gravity is None else -np.asarray(gravity, dtype=np.float64)
    return GroundTruth(
        name=sequence.name,
        classes=sequence.classes,
        objects=sequence.objects,
        up=whole.up if isinstance(whole, FolderWithTruth) else up,
        names=tuple(sequence.names),
        stamps=np.asarray(sequence.stamps, dtype=np.float64),
        poses=sequence.poses,
        frame_truth=sequence.truth,
    )
