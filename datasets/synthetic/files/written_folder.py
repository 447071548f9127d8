"""The folder that a rendered sequence is written to: what may be replaced in it, and what must not be touched."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from ...errors import InputError, UserError
from ...truth_files import FOLDER, TruthPaths, read_record

IMAGES = {"color": ".jpg", "depth": ".png"}  # folders and the suffixes of what is written there
CAMERA_FILE, POSES_FILE = "intrinsics.json", "poses.txt"
_PARTS = (*IMAGES, FOLDER, CAMERA_FILE, POSES_FILE, "accelerometer.txt")  # of a sequence in a plain folder


def check_target(folder: Path, overwrite: bool) -> None:
    """Raises `UserError` where a sequence must not be written to `folder`; changes nothing.

    With `overwrite` a sequence that was written here before may be replaced, and nothing else that a plain folder is
    read from may be there: it would become part of the new one.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(folder, "a folder to write to", "a file", "choose another folder")
    if not folder.is_dir() or not any(folder.iterdir()):
        return
    if not overwrite:
        remedy = "choose another one, or replace its sequence with --overwrite"
        raise UserError(f"{folder}: the folder is not empty; {remedy}")
    foreign = [part for part in _PARTS if (folder / part).exists()]
    if foreign and TruthPaths(folder / FOLDER).record.is_file():
        written = set(_written(folder))
        foreign = [str(file.relative_to(folder)) for file in _files(folder) if file not in written]
    if foreign:
        expected = "nothing that a sequence is read from but what `thingmap synth` wrote"
        remedy = "move it away, or choose another folder"
        raise InputError(folder, expected, ", ".join(foreign[:3]) + (", ..." if len(foreign) > 3 else ""), remedy)


def prepare_folder(folder: Path, overwrite: bool) -> None:
    """Makes the folder and its parts, without an earlier sequence; raises `UserError` as `check_target` does."""
    check_target(folder, overwrite)
    paths = TruthPaths(folder / FOLDER)
    if paths.record.is_file():
        # The record goes last: without it the rest could not be told from files of somebody else.
        for file in sorted(_written(folder), key=lambda file: file == paths.record):
            file.unlink(missing_ok=True)
    try:
        for part in (*(folder / name for name in IMAGES), paths.instances):
            part.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        remedy = "choose a place that you may write to"
        raise UserError(f"{folder}: cannot be made ({error.strerror or error}); {remedy}") from error


def image_files(folder: Path, name: str, index: int) -> tuple[Path, Path, Path]:
    """Colour, depth and instance image of a frame."""
    color, depth = (folder / kind / f"{name}{suffix}" for kind, suffix in IMAGES.items())
    return color, depth, TruthPaths(folder / FOLDER).instance_image(index)


def remove_frames(folder: Path, frames: Iterable[tuple[int, str]]) -> None:
    """Removes the images of frames, given as index and name, where they exist."""
    for index, name in frames:
        for file in image_files(folder, name, index):
            file.unlink(missing_ok=True)


def _written(folder: Path) -> list[Path]:
    """Everything that was written with the `truth.json` in the folder."""
    paths = TruthPaths(folder / FOLDER)
    frames = enumerate(read_record(paths.record).names)
    images = [file for index, name in frames for file in image_files(folder, name, index)]
    return [*images, folder / CAMERA_FILE, folder / POSES_FILE, paths.frames, paths.cloud, paths.record]


def _files(folder: Path) -> list[Path]:
    """The files that a sequence in the folder would be read from."""
    parts = [folder / part for part in _PARTS if (folder / part).exists()]
    return sorted(file for part in parts for file in ([part] if part.is_file() else part.rglob("*")) if file.is_file())
