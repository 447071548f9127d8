"""Everything that learning starts from: views and frames divided up, and looked through for what they lack."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

from ....datasets.errors import UserError
from ....datasets.object_views.backgrounds import Background, Backgrounds
from ....datasets.object_views.object_view import BrokenView, ObjectViews
from ...training.images import kept_frames
from ...training.keeping import Kept
from ...training.selection import BLOCKS, select_views
from .config import TrainConfig
from .outlines import Outline, outline

OnProgress = Callable[[str, int, int], None]  # stage, done, of how many


@dataclass(frozen=True, slots=True, eq=False)
class Material:
    """What the sources gave.

    Attributes:
        views: all of them.
        learned: label -> positions of the views that its codebook is made of; labels sorted.
        held_out: label -> outlines of its views that only the radius and the calibration see.
        instances: label -> instances held out as wholes.
        rival_frames: of the backgrounds, None for one that cannot be used; for radii, and for what is
            none of the classes.
        frames: others of them, for the calibration.
    """

    views: ObjectViews
    learned: dict[str, tuple[int, ...]]
    held_out: dict[str, tuple[Outline, ...]]
    instances: dict[str, int]
    rival_frames: Kept[Background | None]
    frames: Kept[Background | None]

    @property
    def classes(self) -> tuple[str, ...]:
        """Labels, sorted."""
        return tuple(self.learned)


def gather(views: ObjectViews, backgrounds: Backgrounds, config: TrainConfig, on_progress: OnProgress) -> Material:
    """Divides the sources and reads what is held out.

    Raises:
        UserError: there are no views, all of a class are unusable, there is one class alone and no background, or the
            backgrounds have no usable frame or no depth.
    """
    selection = select_views(views, config.held_out, config.views, config.held_out_views, config.seed)
    learned = _by_label(views, selection.learned)
    rival_frames, frames = _frames(backgrounds, config)
    if len(learned) == 1 and len(frames) == 0:
        raise UserError(
            f"{next(iter(learned))!r} alone: there is nothing to tell it from; give --background, or another class"
        )
    for number, indices in enumerate(learned.values()):
        next(read_outlines(views, indices, config))  # now rather than after the work on the classes before it
        on_progress("looking at the objects", number + 1, len(learned))
    held_out = _read_held_out(views, _by_label(views, selection.held_out), config, on_progress)
    return Material(views, learned, held_out, selection.instances, rival_frames, frames)


def read_outlines(
    views: ObjectViews, indices: Sequence[int], config: TrainConfig, on_item: Callable[[int], None] = lambda done: None
) -> Iterator[Outline]:
    """Outlines of views of one class; those that cannot be used are named in `ObjectViews.skipped`.

    Args:
        views: of all classes.
        indices: positions of those wanted, at least one.
        config: the numbers.
        on_item: hears how many views are done.

    Raises:
        UserError: none can be used.
    """
    reasons: Counter[str] = Counter()
    for number, index in enumerate(indices):
        entry = views.entries[index]
        try:
            yield outline(entry.read(), config)
        except BrokenView as broken:
            views.skipped[entry.name] = str(broken)
            reasons[str(broken)] += 1
        on_item(number + 1)
    if reasons.total() == len(indices):
        label, (reason, count) = views.entries[indices[0]].label, reasons.most_common(1)[0]
        raise UserError(
            f"no view of {label!r} can be used: {count} of {len(indices)}: {reason}; give views with depth and a mask, "
            "which meshes, clouds and crops with their masks have, or leave the class out"
        )


def _read_held_out(
    views: ObjectViews, held_out: dict[str, tuple[int, ...]], config: TrainConfig, on_progress: OnProgress
) -> dict[str, tuple[Outline, ...]]:
    outlines, before = {}, 0
    total = sum(map(len, held_out.values()))
    for label, indices in held_out.items():

        def tell(done: int, before: int = before) -> None:
            on_progress("edges of held-out objects", before + done, total)

        outlines[label] = tuple(read_outlines(views, indices, config, tell))
        before += len(indices)
    return outlines


def _by_label(views: ObjectViews, indices: Sequence[int]) -> dict[str, tuple[int, ...]]:
    return {label: tuple(index for index in indices if views.entries[index].label == label) for label in views.labels}


def _frames(backgrounds: Backgrounds, config: TrainConfig) -> tuple[Kept[Background | None], Kept[Background | None]]:
    """Some of the frames, spread evenly: those for the rivals, and those for the calibration, which needs others.

    Blocks of neighbours are kept together: neighbours in a video are nearly the same view. One frame alone is for the
    calibration.

    Raises:
        UserError: there are frames, but none can be used, or they have no depth.
    """
    count = min(len(backgrounds), config.frames)
    indices = np.linspace(0, max(len(backgrounds) - 1, 0), count).round().astype(int)
    blocks = np.array_split(indices, max(min(BLOCKS, count), 1))
    parts = [np.concatenate(blocks[start::2] or [indices[:0]]).tolist() for start in (0, 1)]
    if count == 1:
        parts.reverse()
    rivals, others = (kept_frames(backgrounds, part, config.memory // 2) for part in parts)
    if count == 0:
        return rivals, others
    first = next((frame for frame in chain(others, rivals) if frame is not None), None)
    if first is None:
        raise UserError("no frame of the backgrounds can be used; leave --background out, or give another one")
    if first.depth is None:
        raise UserError(f"{first.name}: the background has no depth; leave it out, or give one with depth")
    return rivals, others
