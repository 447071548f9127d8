"""Evidence of classes in voxels, gathered frame by frame, that moves with the keyframes (Lai et al., section III-A)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from itertools import chain
from pathlib import Path

import numpy as np

from ...datasets.errors import InputError, UserError
from ..trajectory.rigid import inverse, rotation_angle
from .submap import FrozenSubmap, Submap, active_bytes
from .voxel_config import VoxelConfig
from .voxel_file import REMEDY, SubmapStore, read_about, read_submaps, write_submaps
from .voxel_merge import Voxels, merge

__all__ = ["VoxelEvidence", "Voxels"]


class VoxelEvidence:
    """Sums of ln p, positions, colours, normals and counts in voxels of submaps; see `class_slots` for many classes.

    A submap is the voxels of a stretch of frames, in the axes of its first keyframe, the anchor. Frames of later
    keyframes go in by what is known of their poses then; afterwards the submap is rigid and moves with its anchor. It
    ends when the camera has gone too far from the anchor in metres or keyframes, or when it is full (`VoxelConfig`).
    Where submaps overlap, voxels are held more than once until `assemble`.

    Memory: one submap grows, of `submap_voxels` and the points P of a frame rows at most, 76 + 4 (K + 1) bytes each
    (92 + 10 S where only S of K classes are kept apart). Finished ones have 56 + 4 (K + 1) bytes a voxel (73 + 6 for
    each class that it has, at most S) and together no more than `memory` bytes; beyond, the oldest are in files, and
    150 bytes a keyframe remain. See `memory_bound`; finishing one takes as much as it has once more. `assemble` makes
    arrays of the size of the world seen, which no bound holds.

    Args:
        classes: K names.
        config: numbers.
        spill_folder: where a temporary folder for such files is made; None for the system's place.
    """

    def __init__(self, classes: Sequence[str], config: VoxelConfig, spill_folder: Path | None = None) -> None:
        self.classes, self.config = tuple(classes), config
        self.frames = 0  # that were added
        self._active: Submap | None = None
        self._store = SubmapStore(config.memory, len(self.classes), config.kept_classes, spill_folder)

    def add(
        self,
        keyframe: int,
        T_keyframe_camera: np.ndarray,
        points: np.ndarray,
        normals: np.ndarray,
        colours: np.ndarray,
        log_p: np.ndarray,
        T_world_keyframe: np.ndarray | None = None,
    ) -> None:
        """Add one frame.

        Args:
            keyframe: that the frame moves with.
            T_keyframe_camera: (4, 4) in it.
            points: (P, 3) metres, camera axes.
            normals: (P, 3) unit vectors, camera axes, towards the camera; NaN where unknown.
            colours: (P, 3) uint8 RGB.
            log_p: (P, K + 1) ln p(c | x), finite, the background's last.
            T_world_keyframe: (M, 4, 4) poses of keyframes as they are known now, by which frames of several keyframes
                are put into one submap. None: each keyframe has one of its own, which moves with nothing else but takes
                memory for all that keyframes have in common.

        Raises:
            ValueError: arrays do not fit each other, or hold what is not finite.
            UserError: memory is full, and so is the disk.
        """
        T = np.ascontiguousarray(T_keyframe_camera, dtype=np.float64)
        arrays = self._checked(points, normals, colours, log_p, T)
        T_anchor_keyframe = self._place(keyframe, T, T_world_keyframe)
        if T_anchor_keyframe is None:
            self._active, T_anchor_keyframe = self._begun(keyframe), np.eye(4)
        assert self._active is not None
        self.frames += 1
        self._active.keyframes.setdefault(keyframe, T_anchor_keyframe)
        self._active.add(self.frames, T_anchor_keyframe @ T, arrays, self.config.submap_voxels)

    def _checked(self, points, normals, colours, log_p, T: np.ndarray) -> tuple[np.ndarray, ...]:
        count = len(points)
        shapes = np.shape(points), np.shape(normals), np.shape(colours), np.shape(log_p), T.shape
        if shapes != ((count, 3), (count, 3), (count, 3), (count, len(self.classes) + 1), (4, 4)):
            raise ValueError(f"arrays of {count} points and {len(self.classes)} classes have the shapes {shapes}")
        points, log_p = np.ascontiguousarray(points, np.float32), np.ascontiguousarray(log_p, np.float32)
        if not (np.isfinite(points).all() and np.isfinite(log_p).all() and np.isfinite(T).all()):
            raise ValueError("points, log_p and T_keyframe_camera must be finite")
        return points, np.ascontiguousarray(normals, np.float32), np.ascontiguousarray(colours, np.uint8), log_p

    def _place(self, keyframe: int, T: np.ndarray, T_world_keyframe: np.ndarray | None) -> np.ndarray | None:
        """T_anchor_keyframe in the submap that grows; None where a new one must begin."""
        c, active = self.config, self._active
        if active is None or active.used >= c.submap_voxels or abs(keyframe - active.anchor) >= c.submap_keyframes:
            return None
        if keyframe == active.anchor:
            T_anchor_keyframe = np.eye(4)
        elif T_world_keyframe is None:
            return None
        else:
            T_anchor_keyframe = inverse(T_world_keyframe[active.anchor]) @ T_world_keyframe[keyframe]
        near = np.linalg.norm((T_anchor_keyframe @ T)[:3, 3]) <= c.submap_radius
        return T_anchor_keyframe if near else None

    def _begun(self, keyframe: int) -> Submap:
        """A submap without voxels; the one that grew is finished."""
        if (active := self._active) is None:
            return Submap(keyframe, len(self.classes), self.config.kept_classes, self.config.voxel_size)
        self._store.add(active.freeze())
        active.begin_again(keyframe)
        return active

    def assemble(self, T_world_keyframe: np.ndarray) -> Voxels:
        """The voxels of the world under (M, 4, 4) poses of the keyframes; what was gathered stays as it is.

        Raises:
            ValueError: a submap's keyframe has no pose, or it is 2^20 voxels from the origin.
            InputError: a file that was put away has gone.
        """
        return merge(self._submaps(), T_world_keyframe, self.config.voxel_size, len(self.classes))

    def warp(self, T_world_keyframe: np.ndarray) -> tuple[float, float]:
        """How far (M, 4, 4) poses have moved or turned a keyframe at most against the anchor of a submap that holds
        frames of it, since they were added: metres and radians. What is gathered is off by that."""
        held = [(e.anchor, e.keyframes, e.T_anchor_keyframe) for e in self._store.entries]
        if (a := self._active) is not None:
            held.append((a.anchor, np.array(list(a.keyframes)), np.array(list(a.keyframes.values()))))
        moved, turned = 0.0, 0.0
        for anchor, keyframes, T_then in held:
            T_keyframe_world = inverse(T_world_keyframe[anchor])
            for keyframe, T in zip(keyframes, T_then, strict=True):
                change = inverse(T) @ T_keyframe_world @ T_world_keyframe[keyframe]
                moved = max(moved, float(np.linalg.norm(change[:3, 3])))
                turned = max(turned, rotation_angle(change[:3, :3]))
        return moved, turned

    def _submaps(self) -> Callable[[], Iterator[FrozenSubmap]]:
        """Goes through all, the oldest first, each time that it is called."""
        growing = [] if self._active is None else [self._active.freeze()]
        return lambda: chain(self._store, growing)

    @property
    def nbytes(self) -> int:
        """Of the arrays in memory."""
        return self._store.nbytes + (0 if self._active is None else self._active.nbytes)

    @property
    def submaps(self) -> tuple[int, int]:
        """How many there are, and how many of them are in files."""
        return len(self._store) + (self._active is not None), self._store.spilled

    def memory_bound(self, points: int) -> int:
        """Bytes that `nbytes` never exceeds where frames have no more than `points` (P)."""
        row = active_bytes(len(self.classes), self.config.kept_classes)
        return self.config.memory + (self.config.submap_voxels + points) * row

    def save(self, path: Path) -> None:
        """Write an .npz with all there is, whole or absent; raises `UserError` where it cannot be written."""
        about = {"classes": self.classes, "config": asdict(self.config), "frames": self.frames}
        write_submaps(path, about, self._submaps()())

    @classmethod
    def load(cls, path: Path, spill_folder: Path | None = None) -> VoxelEvidence:
        """What `save` wrote, to be assembled or gone on from: frames that are added begin a new submap.

        Raises:
            InputError: the file is absent, damaged, or something else.
        """
        about = read_about(path)
        try:
            evidence = cls(about["classes"], VoxelConfig(**about["config"]), spill_folder)
            evidence.frames = int(about["frames"])
        except (KeyError, TypeError, ValueError, UserError) as error:
            raise InputError(path, "voxels with their classes and configuration", str(error), REMEDY) from None
        for submap in read_submaps(path, len(evidence.classes), evidence.config.kept_classes):
            evidence._store.add(submap)
        return evidence
