"""Things as viewers draw them: arrays, be they landmarks of a mapper at work or things of a finished map."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from ..estimation.landmarks import Landmark
from ..export.colors import class_color
from ..map.boxes import box_axes
from ..map.object_map import ObjectMap

LIGHTER = 0.35  # of the way to white
QUANTILE_95 = 2.7955  # standard deviations in 3D, sqrt of chi-square's 0.95 quantile at 3 degrees of freedom (7.815)


def label_color(label: str) -> np.ndarray:
    """(3,) uint8 RGB: the class's colour, so light that a thin line of it can be seen on a dark ground."""
    color = class_color(label).astype(np.float64)
    return np.round(color + LIGHTER * (255.0 - color)).astype(np.uint8)


class Seen(IntEnum):
    """What the newest keyframe said of a thing: the three groups of `Evidence`, or nothing."""

    OUT_OF_VIEW = 0
    SUPPORTED = 1
    OCCLUDED = 2  # hidden, or not to be told
    CONTRADICTED = 3


@dataclass(frozen=True, slots=True, eq=False)
class ShownThings:
    """N things over K classes.

    Attributes:
        ids: such as "thing-0007".
        classes: K names.
        posterior: (N, K) P(class | it exists).
        existence: (N,) P(it exists).
        position: (N, 3) metres, map frame.
        covariance: (N, 3, 3) of it, m^2.
        size: (N, 3) full extents along the box's axes, metres.
        R_world_box: (N, 3, 3) these axes.
        seen: (N,) `Seen`.
    """

    ids: tuple[str, ...]
    classes: tuple[str, ...]
    posterior: np.ndarray
    existence: np.ndarray
    position: np.ndarray
    covariance: np.ndarray
    size: np.ndarray
    R_world_box: np.ndarray
    seen: np.ndarray

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def class_id(self) -> np.ndarray:
        """(N,) the likeliest class of each."""
        return self.posterior.argmax(axis=1) if len(self) else np.zeros(0, dtype=np.int64)

    @property
    def labels(self) -> list[str]:
        """What each probably is."""
        return [self.classes[k] for k in self.class_id]

    @property
    def names(self) -> list[str]:
        """Label and number, such as "cup 7"."""
        numbers = [i.removeprefix("thing-").lstrip("0") or "0" for i in self.ids]
        return [f"{label} {number}" for label, number in zip(self.labels, numbers, strict=True)]

    @property
    def captions(self) -> list[str]:
        """The same with P(it exists and is that)."""
        best = self.posterior.max(axis=1, initial=0.0) * self.existence
        return [f"{name}: {p:.2f}" for name, p in zip(self.names, best, strict=True)]

    @property
    def colors(self) -> np.ndarray:
        """(N, 3) uint8, of their classes (`label_color`)."""
        return np.array([label_color(label) for label in self.labels], dtype=np.uint8).reshape(-1, 3)

    def select(self, index: np.ndarray) -> ShownThings:
        """Those that a boolean mask (N,) names."""
        arrays = (
            self.posterior,
            self.existence,
            self.position,
            self.covariance,
            self.size,
            self.R_world_box,
            self.seen,
        )
        ids = tuple(i for i, wanted in zip(self.ids, index, strict=True) if wanted)
        return ShownThings(ids, self.classes, *(array[index] for array in arrays))

    def ellipsoids(self) -> tuple[np.ndarray, np.ndarray]:
        """(N, 3) half-axes, metres, and (N, 3, 3) axes of the volumes in which the centres are with 95 %."""
        variances, axes = np.linalg.eigh(self.covariance)
        axes = axes * np.where(np.linalg.det(axes) < 0.0, -1.0, 1.0)[:, None, None]  # a rotation, not a reflection
        return QUANTILE_95 * np.sqrt(np.maximum(variances, 0.0)), axes


def shown_landmarks(
    landmarks: Iterable[Landmark], classes: tuple[str, ...], R_world_upright: np.ndarray, keyframe: int
) -> ShownThings:
    """Landmarks as a mapper has them, with what `keyframe`, the newest one, said of each."""
    ordered = sorted(landmarks, key=lambda landmark: landmark.number)
    return _shown(
        classes,
        ids=[f"thing-{landmark.number:04d}" for landmark in ordered],
        posterior=[landmark.belief.class_posterior() for landmark in ordered],
        existence=[landmark.belief.existence for landmark in ordered],
        position=[landmark.position for landmark in ordered],
        covariance=[(landmark.covariance + landmark.covariance.T) / 2.0 for landmark in ordered],
        size=[2.0 * landmark.half_axes for landmark in ordered],
        R_world_box=[R_world_upright for _ in ordered],
        seen=[_seen(landmark, keyframe) for landmark in ordered],
    )


def shown_map(object_map: ObjectMap) -> ShownThings:
    """The things of a map; nobody looks at them at the moment."""
    things, classes = object_map.things, object_map.classes
    # labels of things that are somehow not among the map's classes come after them
    classes = tuple(dict.fromkeys([*classes, *(label for thing in things for label in thing.class_posterior)]))
    return _shown(
        classes,
        ids=[thing.id for thing in things],
        posterior=[[thing.class_posterior.get(label, 0.0) for label in classes] for thing in things],
        existence=[thing.existence for thing in things],
        position=[thing.position for thing in things],
        covariance=[thing.position_covariance for thing in things],
        size=[thing.size for thing in things],
        R_world_box=[box_axes(thing.yaw, object_map.R_world_upright) for thing in things],
        seen=[Seen.OUT_OF_VIEW for _ in things],
    )


def _seen(landmark: Landmark, keyframe: int) -> Seen:
    if keyframe in landmark.supporting:
        return Seen.SUPPORTED
    if keyframe in landmark.contradicting:
        return Seen.CONTRADICTED
    return Seen.OCCLUDED if keyframe in landmark.occluded else Seen.OUT_OF_VIEW


def _shown(classes: tuple[str, ...], ids: Sequence[str], seen: Sequence[Seen], **values: Sequence) -> ShownThings:
    shapes = {"posterior": (-1, len(classes)), "existence": (-1,), "position": (-1, 3), "size": (-1, 3)}
    arrays = {
        name: np.array(value, dtype=np.float64).reshape(shapes.get(name, (-1, 3, 3)) if value else _none(shapes, name))
        for name, value in values.items()
    }
    return ShownThings(tuple(ids), classes, seen=np.array(seen, dtype=np.int64), **arrays)


def _none(shapes: dict[str, tuple[int, ...]], name: str) -> tuple[int, ...]:
    return (0, *shapes.get(name, (-1, 3, 3))[1:])
