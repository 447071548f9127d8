"""Images in which every object of interest is known: what a detector must stay silent on."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from ..errors import UserError
from ..frame import BrokenFrame
from ..open import LOADERS, SAMPLE_PREFIX, SYNTH_PREFIX, open_sequence
from ..paths import user_path
from ..sequence import Sequence
from .coco_folder import CocoImage, coco_files, coco_images
from .known_boxes import KnownBoxes, known_boxes
from .object_view import BrokenView


@dataclass(frozen=True, slots=True, eq=False)
class Background:
    """One image and the true objects in it.

    Attributes:
        name: of the frame, with that of its sequence.
        color: (H, W, 3) uint8, RGB.
        depth: (H, W) float32 metres, 0 = no reading; None where nothing was measured.
        focal: pixels.
        labels: (N,) class names of the true objects in the image; empty where the source knows none.
        xyxy: (N, 4) float64 pixels, their whole boxes cut to the image, counted from its outer edges.
        visibility: (N,) visible share of each object.
        visible: (N, 4) the boxes of what is seen of them, NaN where that is unknown; None where it is of all.
    """

    name: str
    color: np.ndarray
    depth: np.ndarray | None
    focal: float
    labels: tuple[str, ...]
    xyxy: np.ndarray
    visibility: np.ndarray
    visible: np.ndarray | None = None


class Backgrounds:
    """Frames of sequences, or images of a COCO folder, with the objects that are known to be in them.

    `len` counts what was found; iterating gives those that can be read. A sequence of whose objects nothing is known
    is taken to show none.

    Args:
        sequences: where the frames come from, one sequence after the other.
        stride: take every n-th frame.
        max_frames: take at most so many of each sequence; None for all.

    Attributes:
        skipped: name -> reason of everything left out so far; reading adds to it.

    Raises:
        UserError: stride or max_frames is below 1.
        InputError: a file of true boxes is damaged.
    """

    def __init__(self, *sequences: Sequence, stride: int = 1, max_frames: int | None = None) -> None:
        if stride < 1 or (max_frames is not None and max_frames < 1):
            raise UserError(f"stride and number of frames must be at least 1, got {stride} and {max_frames}")
        self.skipped: dict[str, str] = {}
        self._entries: list[tuple[str, Callable[[], Background]]] = []
        for sequence in sequences:
            names, boxes_of = tuple(sequence.names), known_boxes(sequence)
            for index in range(0, len(sequence), stride)[:max_frames]:
                name = f"{sequence.name} {names[index]}"
                self._entries.append((name, partial(_of_frame, sequence, index, name, boxes_of)))

    @classmethod
    def of_images(cls, images: Iterable[CocoImage]) -> Backgrounds:
        """Annotated images; they have no depth."""
        backgrounds = cls()
        backgrounds._entries = [(image.name, partial(_of_image, image)) for image in images]
        return backgrounds

    @classmethod
    def joined(cls, several: Iterable[Backgrounds]) -> Backgrounds:
        """All of several, one after the other."""
        backgrounds = cls()
        for item in several:
            backgrounds._entries += item._entries
            backgrounds.skipped.update(item.skipped)
        return backgrounds

    @property
    def names(self) -> tuple[str, ...]:
        """Of all frames, unread."""
        return tuple(name for name, _ in self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def __getitem__(self, index: int) -> Background:
        """Reads or renders one.

        Raises:
            BrokenView: it cannot be used.
            IndexError: there is no such frame.
        """
        return self._entries[index][1]()

    def __iter__(self) -> Iterator[Background]:
        for name, read in self._entries:
            try:
                background = read()
            except BrokenView as broken:
                self.skipped[name] = str(broken)
            else:
                yield background


def open_backgrounds(specs: Iterable[str | Path], stride: int = 1, max_frames: int | None = None) -> Backgrounds:
    """Sequences as `open_sequence` understands them, and COCO folders, where these hold no sequence.

    Raises:
        InputError, UserError: as `open_sequence`, `coco_images` and `Backgrounds`.
    """
    several = []
    for spec in map(str, specs):
        images = _coco_images(spec)
        if images is None:
            several.append(Backgrounds(open_sequence(spec), stride=stride, max_frames=max_frames))
        else:
            Backgrounds(stride=stride, max_frames=max_frames)  # checks the two
            several.append(Backgrounds.of_images(images[::stride][:max_frames]))
    return Backgrounds.joined(several)


def _coco_images(spec: str) -> tuple[CocoImage, ...] | None:
    """The images of a COCO folder or its JSON; None for anything else, also for a sequence with such a file."""
    if spec.startswith((SYNTH_PREFIX, SAMPLE_PREFIX)):
        return None
    path = user_path(spec)
    if not path.exists() or (path.is_dir() and any(loader.find(path) for loader in LOADERS)):
        return None
    return coco_images(path) if coco_files(path) else None


def _of_frame(sequence: Sequence, index: int, name: str, boxes_of: Callable[[int], KnownBoxes] | None) -> Background:
    try:
        frame = sequence[index]
    except BrokenFrame as broken:
        raise BrokenView(f"{broken.problem.value} ({broken.detail})") from None
    boxes = KnownBoxes.none() if boxes_of is None else boxes_of(index)
    size = (sequence.intrinsics.width, sequence.intrinsics.height)
    whole, visible = (np.clip(one, 0.0, np.tile(np.array(size, float), 2)) for one in (boxes.xyxy, boxes.visible))
    seen = frame.color, frame.depth, frame.intrinsics.fx
    return Background(name, *seen, boxes.labels, whole, boxes.visibility, visible)


def _of_image(image: CocoImage) -> Background:
    seen = np.ones(len(image.labels))
    return Background(image.name, image.read(), None, image.focal, image.labels, image.xyxy, seen)
