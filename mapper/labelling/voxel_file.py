"""Submaps in files: all of them in one, to go on from later, or the oldest ones while there are too many for memory."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from ...datasets.errors import InputError, UserError
from ..map.atomic import replacing
from .submap import FrozenSubmap, KeptClasses

SCHEMA = "thingmap-voxels/1"
REMEDY = "remove the file, and gather the evidence anew"
ARRAYS = {
    "anchor": np.int64,
    "keyframes": np.int32,
    "T_anchor_keyframe": np.float64,
    "cells": np.int32,
    "counts": np.int32,
    "sums": np.float32,
    "class_sums": np.float32,
}
KEPT_ARRAYS = {"taken": np.uint8, "ids": np.int16, "values": np.float32}


def write_submaps(path: Path, about: Mapping[str, Any], submaps: Iterable[FrozenSubmap]) -> None:
    """One .npz, whole or absent, with only one submap in memory at a time.

    Args:
        path: to write.
        about: what else is to be known of them, for `read_about`; values that JSON knows.
        submaps: taken one after the other.

    Raises:
        UserError: the place cannot be written.
    """
    with replacing(path) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        count = 0
        for submap in submaps:
            for name in ARRAYS:
                _write(archive, f"voxels_{count}_{name}", np.asarray(getattr(submap, name)))
            for name in KEPT_ARRAYS if submap.kept is not None else ():
                _write(archive, f"voxels_{count}_{name}", getattr(submap.kept, name))
            count += 1
        _write(archive, "voxels", np.array(json.dumps({"schema": SCHEMA, "submaps": count, **about})))


def _write(archive: zipfile.ZipFile, name: str, array: np.ndarray) -> None:
    with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
        np.lib.format.write_array(member, array, allow_pickle=False)


def read_about(path: Path) -> dict[str, Any]:
    """What `write_submaps` was given, with the number of `submaps`; raises `InputError` for any other file."""
    try:
        with np.load(path, allow_pickle=False) as content:
            about = json.loads(str(content["voxels"]))
        if about["schema"] != SCHEMA or not isinstance(about["submaps"], int):
            raise ValueError(f"schema {about['schema']!r}")
        return about
    except KeyError as error:
        raise _damaged(path, f"none of {error}") from None
    except (OSError, ValueError, TypeError, EOFError, zipfile.BadZipFile) as error:
        raise _damaged(path, str(error)) from None


def read_submaps(path: Path, classes: int, kept: int) -> Iterator[FrozenSubmap]:
    """The submaps of a file, one at a time; raises `InputError` where they are damaged or of other than K classes."""
    width = classes + 1 if classes <= kept else None
    for number in range(read_about(path)["submaps"]):
        try:
            with np.load(path, allow_pickle=False) as content:
                arrays = {name: content[f"voxels_{number}_{name}"] for name in ARRAYS}
                some = None if width else {name: content[f"voxels_{number}_{name}"] for name in KEPT_ARRAYS}
            yield _submap(arrays, some, classes, width)
        except KeyError as error:
            raise _damaged(path, f"none of {error}") from None
        except (OSError, ValueError, TypeError, EOFError, zipfile.BadZipFile) as error:
            raise _damaged(path, str(error)) from None


def _submap(
    arrays: dict[str, np.ndarray], some: dict[str, np.ndarray] | None, classes: int, width: int | None
) -> FrozenSubmap:
    """Checked: the loops over voxels look at no bounds."""
    for name, kind in (ARRAYS | KEPT_ARRAYS).items():
        array = arrays.get(name) if name in arrays else (some or {}).get(name)
        if array is not None and array.dtype != kind:
            raise ValueError(f"{name} of type {array.dtype}")
    kept = None if some is None else KeptClasses(**some)
    submap = FrozenSubmap(**{**arrays, "anchor": int(arrays["anchor"])}, kept=kept)
    if width is not None and submap.class_sums.shape[1] != width:
        raise ValueError(f"{submap.class_sums.shape[1]} sums of classes a voxel, not {width}")
    if kept is not None and (kept.ids >= classes).any():
        raise ValueError(f"class {kept.ids.max()} of {classes}")
    return submap


def _damaged(path: Path, found: str) -> InputError:
    return InputError(path, "voxels as thingmap writes them (.npz)", found, REMEDY)


@dataclass(frozen=True, slots=True, eq=False)
class Spilled:
    """What stays in memory of a submap in a file."""

    file: Path
    anchor: int
    keyframes: np.ndarray
    T_anchor_keyframe: np.ndarray


class SubmapStore:
    """Finished submaps: in memory up to so many bytes, the oldest ones beyond that in files of a temporary folder.

    Args:
        memory: bytes of arrays.
        classes, kept: K and S of the submaps.
        folder: where the temporary folder is made, which goes with the store; None for the system's place.
    """

    def __init__(self, memory: int, classes: int, kept: int, folder: Path | None = None) -> None:
        self._memory, self._classes, self._kept, self._parent = memory, classes, kept, folder
        self._entries: list[FrozenSubmap | Spilled] = []
        self._folder: TemporaryDirectory[str] | None = None
        self._resident = 0  # the first entry that is in memory
        self.nbytes = 0

    def __len__(self) -> int:
        return len(self._entries)

    @property
    def entries(self) -> tuple[FrozenSubmap | Spilled, ...]:
        """All, the oldest first, without reading a file."""
        return tuple(self._entries)

    @property
    def spilled(self) -> int:
        """How many are in files."""
        return self._resident

    def add(self, submap: FrozenSubmap) -> None:
        """Raises `UserError` where memory is full and the disk too."""
        self._entries.append(submap)
        self.nbytes += submap.nbytes
        while self.nbytes > self._memory:
            self._spill_oldest()

    def __iter__(self) -> Iterator[FrozenSubmap]:
        """The oldest first; of those in files one at a time is in memory."""
        for entry in self.entries:
            if isinstance(entry, Spilled):
                yield from read_submaps(entry.file, self._classes, self._kept)
            else:
                yield entry

    def _spill_oldest(self) -> None:
        submap = self._entries[self._resident]
        assert isinstance(submap, FrozenSubmap)
        if self._folder is None:
            try:
                self._folder = TemporaryDirectory(prefix="thingmap-voxels-", dir=self._parent)
            except OSError as error:
                raise UserError(
                    f"{self._parent or 'the temporary folder'}: cannot be written ({error.strerror or error}); voxels "
                    "beyond the configured memory go there: allow more memory, or choose a place with room"
                ) from None
        file = Path(self._folder.name) / f"{self._resident}.npz"
        write_submaps(file, {}, [submap])
        self._entries[self._resident] = Spilled(file, submap.anchor, submap.keyframes, submap.T_anchor_keyframe)
        self._resident += 1
        self.nbytes -= submap.nbytes
