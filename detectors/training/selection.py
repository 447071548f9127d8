"""Which views are learned from, and which only calibration sees."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from ...datasets.errors import UserError
from ...datasets.object_views.object_view import ObjectViews, ViewEntry

FEWEST_INSTANCES = 3  # from so many on, a class gives whole instances away; with two, half of what there is would go
LARGEST_LOSS = 2.0  # times the share held out, that an instance may have of a class's views to be given away
BLOCKS = 20  # of neighbouring views, kept or given away together: neighbours in a video are nearly the same view
FEWEST_VIEWS = 5  # with fewer, a class gives none away


@dataclass(frozen=True, slots=True)
class Selection:
    """Positions in `ObjectViews.entries`, ascending.

    Attributes:
        learned: what is learned from.
        held_out: what only calibration sees; of a class with too few views, those that are learned from.
        instances: label -> instances held out as wholes; 0 where views of every instance were.
    """

    learned: tuple[int, ...]
    held_out: tuple[int, ...]
    instances: dict[str, int]


def select_views(
    views: ObjectViews, share: float = 0.2, most: int = 300, most_held_out: int = 60, seed: int = 0
) -> Selection:
    """Divides the views of every class.

    Args:
        views: of all classes.
        share: of instances, or of views, that are held out.
        most: views of a class that are learned from, spread evenly.
        most_held_out: the same of those held out.
        seed: of which instances these are.

    Raises:
        UserError: there are no views.
    """
    if len(views) == 0:
        raise UserError("no views of objects to learn from; `thingmap train --help` says which folders are understood")
    by_label: dict[str, list[int]] = {label: [] for label in views.labels}
    for index, entry in enumerate(views.entries):
        by_label[entry.label].append(index)
    learned, held_out, instances = [], [], {}
    for number, (label, indices) in enumerate(by_label.items()):
        rng = np.random.default_rng([seed, 1, number])
        given, instances[label] = _given_away(views.entries, indices, share, rng)
        rest = [index for index in indices if index not in given]
        learned += _spread(rest, most)
        held_out += _spread(sorted(given) or rest, most_held_out)
    return Selection(tuple(sorted(learned)), tuple(sorted(held_out)), instances)


def _given_away(
    entries: tuple[ViewEntry, ...], indices: list[int], share: float, rng: np.random.Generator
) -> tuple[set[int], int]:
    """Views of one class that are held out, and the number of whole instances that they are.

    An instance that has a large part of the views stays: of one scan and two snapshots, the scan is learned from.
    """
    if len(indices) < FEWEST_VIEWS:
        return set(), 0
    instances = list(dict.fromkeys(entries[index].instance for index in indices))
    sizes = Counter(entries[index].instance for index in indices)
    small = [name for name in instances if sizes[name] <= LARGEST_LOSS * share * len(indices)]
    if len(instances) >= FEWEST_INSTANCES and small:
        count = min(max(round(share * len(instances)), 1), len(small))
        chosen = {small[k] for k in rng.choice(len(small), count, replace=False)}
        return {index for index in indices if entries[index].instance in chosen}, count
    every = max(round(1.0 / share), 2)
    given: set[int] = set()
    for name in instances:
        own = [index for index in indices if entries[index].instance == name]
        for block in np.array_split(np.array(own), BLOCKS)[every - 1 :: every]:
            given.update(block.tolist())
    return given, 0


def _spread(indices: list[int], most: int) -> list[int]:
    """At most so many of the indices, evenly."""
    if len(indices) <= most:
        return indices
    return [indices[k] for k in np.linspace(0, len(indices) - 1, most).round().astype(int)]


def split_frames(count: int, share: float) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Positions of background frames to mine, and of those held out: blocks of neighbours, as with views.

    Of fewer than `FEWEST_VIEWS` frames all are both.
    """
    frames = np.arange(count)
    if count < FEWEST_VIEWS:
        return tuple(frames.tolist()), tuple(frames.tolist())
    every = max(round(1.0 / share), 2)
    held_out = np.concatenate(np.array_split(frames, min(BLOCKS, count))[every - 1 :: every])
    return tuple(np.setdiff1d(frames, held_out).tolist()), tuple(held_out.tolist())
