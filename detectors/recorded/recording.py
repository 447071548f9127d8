"""What every reader of a recorded format hands over."""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path, PurePosixPath
from typing import Any

from ..detections import Detections
from .run_lengths import RunLengths

_IMAGE_SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".bmp", ".ppm", ".pgm", ".tif", ".tiff", ".webp"})
_COLOR_SUFFIXES = frozenset({".color", ".rgb"})


class MatchedBy(Enum):
    """How recorded frames find those of a sequence."""

    NAME = "name"
    INDEX = "position in the sequence"
    NUMBER = "number at the start of the name"

    def key(self, index: int, name: str) -> Hashable:
        """What a frame is looked up by."""
        if self is MatchedBy.INDEX:
            return index
        return frame_key(name) if self is MatchedBy.NAME else leading_number(name)


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """Detections of many frames, boxes as written: not clipped yet.

    Attributes:
        classes: the same for all frames.
        frames: detections without masks, by the key of `matched_by`.
        matched_by: what the keys are.
        normalised: boxes are in units of the image's width and height instead of pixels.
        sizes: (width, height) of the images the boxes belong to, where the file tells.
        masks: one a detection, for the frames that have them; packed, since whole sequences of masks fill memory.
    """

    classes: tuple[str, ...]
    frames: Mapping[Any, Detections]
    matched_by: MatchedBy = MatchedBy.NAME
    normalised: bool = False
    sizes: Mapping[Any, tuple[int, int]] = field(default_factory=dict)
    masks: Mapping[Any, RunLengths] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class ReadOptions:
    """What a user may add to a file that does not say everything; each format uses some.

    Attributes:
        names: class names by number, or a file of them.
        label: the one class of boxes without a class.
        images: COCO file that lists `images` and `categories` for a file of results.
    """

    names: tuple[str, ...] | Path | str | None = None
    label: str | None = None
    images: Path | str | None = None


class Malformed(ValueError):
    """What is wrong in a recorded file, and where in it."""


@contextmanager
def within(where: str = "") -> Iterator[None]:
    """Turn a missing field or a wrong value into `Malformed`, and say where in the file it was met."""
    at = f"{where}: " if where else ""
    try:
        yield
    except Malformed as error:
        raise Malformed(f"{where}, {error}" if where else str(error)) from None
    except KeyError as error:
        raise Malformed(f"{at}no {error.args[0]!r}") from None
    except (ValueError, TypeError, AttributeError, OverflowError) as error:
        raise Malformed(f"{at}{error}") from None


def frame_key(name: str) -> str:
    """The part of a frame's or image file's name that both sides agree on: no folders, no image suffix, no `.color`."""
    key = PurePosixPath(name.replace("\\", "/")).name
    for suffixes in (_IMAGE_SUFFIXES, _COLOR_SUFFIXES):
        stem, dot, suffix = key.rpartition(".")
        # Only known suffixes: the names of TUM's frames are stamps, `1311868164.363181`.
        key = stem if stem and dot + suffix.lower() in suffixes else key
    return key


def leading_number(name: str) -> int | None:
    """The number that a name starts with; None where it starts with something else."""
    digits = re.match(r"\d+", frame_key(name))
    return int(digits.group()) if digits else None


def add_frame(frames: dict[Any, Any], key: Hashable, value: Any) -> None:
    """Put a frame in; a second one of the same name is a mistake that must not go unseen."""
    if key in frames:
        raise Malformed(f"two frames named {key!r}")
    frames[key] = value
