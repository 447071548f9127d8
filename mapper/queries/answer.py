"""One thing that answers a question."""

from __future__ import annotations

from dataclasses import dataclass

from ..map.thing import Thing

PROBABLE = 0.5  # by default a question about places is answered with what is more likely true than not


@dataclass(frozen=True, slots=True)
class Answer:
    """One thing that answers a question.

    Attributes:
        thing: with its covariance and its whole class posterior.
        probability: P(the thing is what was asked for); with a region, also that its centre is in there; with a
            relation, also that it holds.
        distance: metres from the point asked about to the thing's centre; of `next_to`, the horizontal gap between the
            boxes; None for other questions.
        distance_std: standard deviation of `distance`, metres, from what is not known of positions (and sizes).
    """

    thing: Thing
    probability: float
    distance: float | None = None
    distance_std: float | None = None
