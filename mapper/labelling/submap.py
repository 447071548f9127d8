"""Voxels in the axes of one keyframe: those of a stretch of frames, while it grows and afterwards."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .class_slots import add_some_classes
from .voxel_hash import (
    CELL,
    CLASSES,
    FREE,
    GEOMETRY,
    LAST_FRAME,
    POINTS,
    add_points,
    fill_table,
    split_rows,
)

SLOT_SUMS = 4  # FLOOR, BACKGROUND, LOST and BOUND
SLOT_TYPES = np.int16, np.float32, np.float32  # of ids, values and before
TABLE_PLACES = 4  # of the hash table for each row, at most


@dataclass(frozen=True, slots=True, eq=False)
class KeptClasses:
    """The classes of V voxels that keep only some, U in all (see `class_slots`).

    Attributes:
        taken: (V,) uint8, how many a voxel has.
        ids: (U,) int16 classes, voxel after voxel.
        values: (U,) float32 excess over the floor, summed.
    """

    taken: np.ndarray
    ids: np.ndarray
    values: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class FrozenSubmap:
    """V voxels that no longer change: 56 bytes each, and 4 (K + 1) for classes; where only some are kept, 17 and 6 for
    each of those that the voxel has.

    Attributes:
        anchor: the keyframe that they move with.
        keyframes: (F,) int32 that frames hung on.
        T_anchor_keyframe: (F, 4, 4) of those, as it was when their frames were added.
        cells: (V, 3) int32, anchor's axes.
        counts: (V, 2) int32 points and views.
        sums: (V, 9) float32: positions in the cell, in its edges; RGB; normals, anchor's axes.
        class_sums: (V, K + 1) float32 ln p, or (V, 4) where only some classes are kept (see `class_slots`).
        kept: those, or None.

    Raises:
        ValueError: arrays do not fit each other.
    """

    anchor: int
    keyframes: np.ndarray
    T_anchor_keyframe: np.ndarray
    cells: np.ndarray
    counts: np.ndarray
    sums: np.ndarray
    class_sums: np.ndarray
    kept: KeptClasses | None

    def __post_init__(self) -> None:
        rows = len(self.cells)
        shapes = self.cells.shape, self.counts.shape, self.sums.shape, self.T_anchor_keyframe.shape
        if shapes != ((rows, 3), (rows, 2), (rows, GEOMETRY), (len(self.keyframes), 4, 4)):
            raise ValueError(f"arrays of {rows} voxels have the shapes {shapes}")
        if self.class_sums.ndim != 2 or len(self.class_sums) != rows or (rows and self.counts.min() < 1):
            raise ValueError(f"{rows} voxels have class sums of shape {self.class_sums.shape}, or no points")
        if (k := self.kept) is not None:
            sizes = k.taken.shape, k.ids.shape, k.values.shape, self.class_sums.shape[1]
            total = int(k.taken.sum(dtype=np.int64))
            if sizes != ((rows,), (total,), (total,), SLOT_SUMS) or (total and k.ids.min() < 0):
                raise ValueError(f"kept classes of {rows} voxels have the shapes {sizes}")

    def __len__(self) -> int:
        return len(self.cells)

    @property
    def nbytes(self) -> int:
        """Of all arrays."""
        arrays = [self.keyframes, self.T_anchor_keyframe, self.cells, self.counts, self.sums, self.class_sums]
        if self.kept is not None:
            arrays += [self.kept.taken, self.kept.ids, self.kept.values]
        return sum(array.nbytes for array in arrays)


def active_bytes(classes: int, kept: int) -> int:
    """Bytes that one row of a growing submap takes at most: 76 + 4 (K + 1), or 92 + 10 for each class to be kept."""
    per_class = 4 * (classes + 1) if classes <= kept else 4 * SLOT_SUMS + 10 * kept
    return 4 * CLASSES + 4 * TABLE_PLACES + per_class


@dataclass(slots=True, eq=False)
class Submap:
    """Voxels that frames are added to.

    Once they are finished, another one can go on in the same memory: what the system gives anew it has to clear first,
    and a room's first frame took 10 ms for that, the others 4.

    Attributes:
        anchor: the keyframe in whose axes they are.
        classes: K.
        kept: S; with more than that in all, voxels keep only so many apart.
        size: metres, a voxel's edge.
        keyframes: keyframe -> (4, 4) T_anchor_keyframe, of those that frames hung on.
        used: rows that hold a voxel.
    """

    anchor: int
    classes: int
    kept: int
    size: float
    keyframes: dict[int, np.ndarray] = field(default_factory=dict)
    used: int = 0
    _table: np.ndarray = field(init=False)
    _rows: np.ndarray = field(init=False)
    _slots: tuple[np.ndarray, ...] = field(init=False)  # ids, values, before; none where all classes are kept

    def __post_init__(self) -> None:
        exact = self.classes <= self.kept
        self._table = np.zeros(1, np.int32)
        self._rows = np.zeros((0, CLASSES + (self.classes + 1 if exact else SLOT_SUMS)), np.float32)
        self._slots = tuple(np.zeros((0, self.kept), kind) for kind in (() if exact else SLOT_TYPES))

    @property
    def nbytes(self) -> int:
        """Of all arrays, also rows that are still free and that the system has given no memory yet."""
        return sum(array.nbytes for array in (self._table, self._rows, *self._slots))

    def add(self, frame: int, T_anchor_camera: np.ndarray, arrays: tuple[np.ndarray, ...], most: int) -> None:
        """Add a frame's (P, 3) points, normals and colours and (P, K + 1) log probabilities, in camera axes.

        Args:
            frame: its number, from 1 on; no other frame has it.
            T_anchor_camera: (4, 4).
            arrays: points, normals, colours, log_p; of one length, contiguous.
            most: voxels that there are before a frame, at most.
        """
        points, normals, colours, log_p = arrays
        self._make_room(len(points), most)
        found = points, normals, colours, np.empty((len(points), 0), np.float32) if self._slots else log_p
        store = self._table, self._rows.view(np.int32), self._rows
        first = self.used
        rows, self.used, _ = add_points(T_anchor_camera, self.size, *found, frame, *store, first)
        if self._slots:
            for array in self._slots:  # they may have been used before
                array[first : self.used] = 0
            add_some_classes(rows, log_p, self._rows, *self._slots)

    def _make_room(self, more: int, most: int) -> None:
        """Rows for all that there can be: the system gives memory only to those that are written to."""
        if self.used + more <= len(self._rows):
            return
        capacity = most + more
        self._rows = self._enlarged(self._rows, capacity)
        self._slots = tuple(self._enlarged(array, capacity) for array in self._slots)
        self._table = np.zeros(1 << int(2 * capacity - 1).bit_length(), np.int32)  # half empty at least
        fill_table(self._table, self._rows.view(np.int32), self.used)

    def _enlarged(self, old: np.ndarray, capacity: int) -> np.ndarray:
        new = np.zeros((capacity, old.shape[1]), old.dtype)
        new[: self.used] = old[: self.used]
        return new

    def freeze(self) -> FrozenSubmap:
        """A copy without room to grow."""
        V, floats, kept = self.used, self._rows, None
        cells, counts = np.empty((V, POINTS - CELL), np.int32), np.empty((V, LAST_FRAME - POINTS), np.int32)
        sums, class_sums = np.empty((V, GEOMETRY), np.float32), np.empty((V, floats.shape[1] - CLASSES), np.float32)
        split_rows(floats.view(np.int32), floats, cells, counts, sums, class_sums)
        if self._slots:
            ids, values, _ = (array[:V] for array in self._slots)
            taken = ids != FREE
            kept = KeptClasses(taken.sum(axis=1, dtype=np.uint8), ids[taken] - np.int16(1), values[taken])
        return FrozenSubmap(
            anchor=self.anchor,
            keyframes=np.array(list(self.keyframes), dtype=np.int32),
            T_anchor_keyframe=np.array(list(self.keyframes.values()), dtype=np.float64).reshape(-1, 4, 4),
            cells=cells,
            counts=counts,
            sums=sums,
            class_sums=class_sums,
            kept=kept,
        )

    def begin_again(self, anchor: int) -> None:
        """Forget the voxels, and go on in the axes of another keyframe."""
        self.anchor, self.keyframes, self.used = anchor, {}, 0
        self._table.fill(FREE)
