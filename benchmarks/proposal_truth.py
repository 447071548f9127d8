"""Which proposals show a true thing: by the visible pixels of the things of a rendered scene, or by a label map."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from thingmap.datasets.frame import Frame
from thingmap.datasets.synthetic.synth import open_synth
from thingmap.detectors.proposals.proposals import Proposals

RIGHT = 0.5  # intersection over union
LEAST_PIXELS = 400  # of a thing in view, at 640 x 480
LEAST_READ = 0.5  # share of its pixels with a depth
FARTHEST = 3.5  # metres, median depth: a structured-light camera tells a mug from the table up to about there


@dataclass(frozen=True, slots=True, eq=False)
class Match:
    """Proposals of an image against its true things.

    Attributes:
        iou: (M, N) of the visible pixels of M things and N proposals.
        is_object: (M,) of a class of the scene; the others are clutter, which nobody names.
        counts: (M,) whether the thing can be asked for: large, near and read well enough.
    """

    iou: np.ndarray
    is_object: np.ndarray
    counts: np.ndarray

    @property
    def found(self) -> np.ndarray:
        """(M,) whether one proposal is this thing."""
        return self.iou.max(axis=1, initial=0.0) >= RIGHT

    @property
    def right(self) -> np.ndarray:
        """(N,) whether the proposal is one thing."""
        return self.iou.max(axis=0, initial=0.0) >= RIGHT


def match(found: Proposals, instances: np.ndarray, depth: np.ndarray, objects: int) -> Match:
    """Proposals of an image against its instance image (H, W): ids from 0, negative for nothing; objects come first."""
    on = instances >= 0
    ids, thing = np.unique(instances[on], return_inverse=True)
    count = len(found)
    both = np.bincount(thing * (count + 1) + found.labels[on] + 1, minlength=len(ids) * (count + 1))
    both = both.reshape(len(ids), count + 1)
    pixels = both.sum(axis=1)
    area = np.bincount(found.labels[found.labels >= 0], minlength=count)
    common = both[:, 1:]
    iou = common / np.maximum(pixels[:, None] + area[None, :] - common, 1)
    read = np.bincount(thing, depth[on] > 0, len(ids))
    far = np.array(
        [np.median(depth[(instances == i) & (depth > 0)]) if n else np.inf for i, n in zip(ids, read, strict=True)]
    )
    scale = instances.size / (640 * 480)
    counts = (pixels >= LEAST_PIXELS * scale) & (read >= LEAST_READ * pixels) & (far <= FARTHEST)
    return Match(iou, ids < objects, counts)


def rendered(lines: list[str], frames: int) -> Iterator[tuple[str, Frame, np.ndarray, int]]:
    """(line, frame, instance image, number of objects) of so many frames of each scene, evenly along its path."""
    for line in lines:
        sequence = open_synth(line)
        for index in np.linspace(0, len(sequence) - 1, frames + 2)[1:-1].astype(int):
            yield line, sequence[int(index)], sequence.instances(int(index)), len(sequence.objects)
