"""One thing of the map: what it probably is, where it probably is, and on what evidence."""

from __future__ import annotations

import operator
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ...datasets.errors import UserError
from .boxes import box_corners
from .explain import explain_thing
from .explanation import Explanation
from .thing_checks import POSTERIOR_TOLERANCE, check_covariance, finite, read_only
from .views_file import StoredViews, ThingViews
from .volume import Volume

if TYPE_CHECKING:
    from ..edits.edit import Edit
    from ..edits.merged_views import MergedViews
    from .appearance import SomeAppearance


@dataclass(frozen=True, slots=True)
class Evidence:
    """How many views spoke for a thing, could not see it, and spoke against it."""

    supporting: int
    occluded: int
    contradicting: int

    def __post_init__(self) -> None:
        for name in ("supporting", "occluded", "contradicting"):
            count = operator.index(getattr(self, name))  # NumPy's integers become Python's
            if count < 0:
                raise ValueError(f"{name} must not be negative, but got {count}")
            object.__setattr__(self, name, count)


@dataclass(frozen=True, slots=True, eq=False)
class Thing:
    """A countable object as an upright box.

    Attributes:
        id: stable name, such as "thing-0007".
        label: its likeliest class.
        probability: P(label | it exists).
        existence: P(it exists).
        class_posterior: label -> P(label | it exists). A class that is absent has a probability too small to be kept,
            so the sum may fall short of 1 by what was left out.
        position: (3,) centre, metres, map frame.
        position_covariance: (3, 3) of `position`, m^2.
        size: (3,) full extents along the box's own axes, metres; the third is the height along up.
        size_std: (3,) standard deviations of `size`, metres.
        yaw: radians about up, from the upright frame's x axis (`upright_rotation`) to the box's.
        first_seen: stamp of the first supporting view, seconds.
        last_seen: stamp of the last supporting view, seconds.
        evidence: counts of views.
        views: what each of them said, in memory or in the map's evidence file; None where nobody knows. See `explain`.
        points: of the labelled cloud that are its own; None where nobody knows. `ObjectMap.points` gives them.
        volume: what the graph had of its place and size, where its points have told better: then `position`, `size`,
            `size_std` and `yaw` are what those tell. None elsewhere.
        name: that somebody gave this one; None without.
        edits: what people changed of it, the oldest first; the other values are what came of them.
        appearance: how it looks, in memory or in the map's file of embeddings; None where nobody knows. See
            `embedding`.

    Raises:
        ValueError: where a shape or a value is not as above; it says which and what was found.
    """

    id: str
    label: str
    probability: float
    existence: float
    class_posterior: Mapping[str, float]
    position: np.ndarray
    position_covariance: np.ndarray
    size: np.ndarray
    size_std: np.ndarray
    yaw: float
    first_seen: float
    last_seen: float
    evidence: Evidence
    views: ThingViews | StoredViews | MergedViews | None = field(default=None, repr=False)
    points: int | None = None
    volume: Volume | None = None
    name: str | None = None
    edits: tuple[Edit, ...] = ()
    appearance: SomeAppearance | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        for name, shape in (("position", (3,)), ("position_covariance", (3, 3)), ("size", (3,)), ("size_std", (3,))):
            object.__setattr__(self, name, read_only(name, getattr(self, name), shape))
        for name in ("probability", "existence", "yaw", "first_seen", "last_seen"):
            object.__setattr__(self, name, finite(name, getattr(self, name)))
        if self.points is not None:
            object.__setattr__(self, "points", operator.index(self.points))
        posterior = {str(label): finite(f"class_posterior[{label!r}]", p) for label, p in self.class_posterior.items()}
        object.__setattr__(self, "class_posterior", posterior)
        self._check()

    @classmethod
    def of_checked(cls, **values: Any) -> Thing:
        """From the values of all fields, which were checked and made read-only already, as those of many things are at
        once (`things_from_document`)."""
        thing = object.__new__(cls)
        for name, value in values.items():
            object.__setattr__(thing, name, value)
        return thing

    def _check(self) -> None:
        if not self.label:
            raise ValueError("label must not be empty")
        for name in ("probability", "existence"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} must be in [0, 1], but got {getattr(self, name)}")
        values = self.class_posterior.values()
        if any(not 0.0 <= p <= 1.0 for p in values) or sum(values) > 1.0 + POSTERIOR_TOLERANCE:
            raise ValueError(f"class_posterior must be probabilities that sum to at most 1, got {self.class_posterior}")
        kept = self.class_posterior.get(self.label)
        if kept is None or abs(kept - self.probability) > POSTERIOR_TOLERANCE:
            raise ValueError(f"probability {self.probability} must be class_posterior[{self.label!r}], which is {kept}")
        if min(self.size.tolist()) < 0.0 or min(self.size_std.tolist()) < 0.0:
            raise ValueError(f"size and size_std must not be negative, but got {self.size} and {self.size_std}")
        if self.points is not None and self.points < 0:
            raise ValueError(f"points must not be negative, but got {self.points}")
        check_covariance("position_covariance", self.position_covariance)

    @property
    def position_std(self) -> np.ndarray:
        """(3,) standard deviations of `position` along the map's axes, metres."""
        return np.sqrt(np.maximum(np.diag(self.position_covariance), 0.0))

    @property
    def embedding(self) -> np.ndarray | None:
        """(D,) float32 of length 1, read-only: mean of the detector's embeddings of it; None where there were none.

        Raises:
            InputError: the map's file of embeddings is missing, damaged or of another map.
        """
        known = None if self.appearance is None else self.appearance.read()
        return None if known is None else known.embedding

    def belief(self, label: str) -> float:
        """P(it exists and is a `label`); upper and lower case are the same, 0 for a class it never was."""
        wanted = label.casefold()
        return self.existence * sum(p for name, p in self.class_posterior.items() if name.casefold() == wanted)

    def explain(self, label: str | None = None, *, in_time_order: bool = False) -> Explanation:
        """Why: what every view on record said for or against this thing being a `label`, and what people said.

        Args:
            label: any class of the map, upper and lower case being the same; the likeliest by default. Of one that only
                a person gave to this thing, the views are shown for the likeliest that was looked for.
            in_time_order: instead of the strongest view first.

        Raises:
            UserError: no such label, or nothing is on record: it says what is missing and what to do.
            InputError: the map's evidence file is missing, damaged or of another map.
        """
        if self.views is None:
            raise UserError(f"{self.id}: nothing is on record of its views; take it from a mapper or a run's map")
        return explain_thing(self, self.views.read(), self.label if label is None else label, in_time_order)

    def corners(self, R_world_upright: np.ndarray) -> np.ndarray:
        """(8, 3) corners of the box, metres, map frame; order and edges as in `boxes`."""
        return box_corners(self.position, self.size, self.yaw, R_world_upright)
