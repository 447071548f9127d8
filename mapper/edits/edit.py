"""What somebody changed in a map: an edit, and of which things it was said."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any

import numpy as np

from ...datasets.json_record import JsonRecord

if TYPE_CHECKING:
    from ..map.thing import Thing


class Action(StrEnum):
    """What an edit does."""

    RELABEL = "relabel"
    DELETE = "delete"
    MOVE = "move"
    RESIZE = "resize"
    MERGE = "merge"
    NAME = "name"


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """A thing as the mapper had estimated it when somebody spoke of it; by this it is known again.

    Attributes:
        id: its id.
        label: its likeliest class then.
        class_posterior: label -> P(label | it exists) then.
        position, position_covariance: (3,) metres, map frame; (3, 3) m^2.
        size: (3,) full extents, metres.
    """

    id: str
    label: str
    class_posterior: Mapping[str, float]
    position: np.ndarray
    position_covariance: np.ndarray
    size: np.ndarray

    @classmethod
    def of(cls, thing: Thing) -> Target:
        """Of a thing that no edit has touched."""
        likely = {label: p for label, p in thing.class_posterior.items() if p >= 1e-3 or label == thing.label}
        return cls(thing.id, thing.label, likely, thing.position, thing.position_covariance, thing.size)

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values; the inverse is `from_record`."""
        return {
            "id": self.id,
            "label": self.label,
            "class_posterior": {label: round(p, 6) for label, p in self.class_posterior.items()},
            "position": self.position.tolist(),
            "position_covariance": self.position_covariance.tolist(),
            "size": self.size.tolist(),
        }

    @classmethod
    def from_record(cls, record: JsonRecord) -> Target:
        """Raises `InputError` where a value is missing or of another kind."""
        return cls(
            id=record.name("id"),
            label=record.name("label"),
            class_posterior=record.numbers_by_name("class_posterior"),
            position=record.array("position", (3,)),
            position_covariance=record.array("position_covariance", (3, 3)),
            size=record.array("size", (3,)),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Edit:
    """One change, with its provenance.

    Attributes:
        number: in the journal, from 1.
        action: what it does.
        targets: the things that it is about, as they had been estimated; more than one for a merge, where the first
            keeps its id.
        who: said so.
        when: UTC, ISO 8601, such as "2026-03-01T09:30:00Z".
        why: in that person's words; may be empty.
        label: of a relabel.
        probability: P(label | it exists) that a relabel states.
        position: (3,) metres, of a move: the centre.
        size: (3,) metres, of a resize: full extents along the box's own axes.
        std: (3,) metres: standard deviations, of `position` along the map's axes, or of `size`.
        name: that a name gives; empty to take it away.
    """

    number: int
    action: Action
    targets: tuple[Target, ...]
    who: str
    when: str
    why: str = ""
    label: str | None = None
    probability: float | None = None
    position: np.ndarray | None = None
    size: np.ndarray | None = None
    std: np.ndarray | None = None
    name: str | None = None

    @property
    def thing_id(self) -> str:
        """Id of the thing that it is about; of a merge, of the one that stays."""
        return self.targets[0].id

    def __str__(self) -> str:
        """What it does, such as "relabel thing-0003 from cup to mug"."""
        things = " ".join(target.id for target in self.targets)
        match self.action:
            case Action.RELABEL:
                return f"relabel {things} from {self.targets[0].label} to {self.label} (P {self.probability:g})"
            case Action.MOVE:
                return f"move {things} to {_with_std(self.position, self.std)} m"
            case Action.RESIZE:
                return f"resize {things} to {_with_std(self.size, self.std)} m"
            case Action.NAME:
                return f"name {things} {self.name!r}" if self.name else f"name {things} no more"
        return f"{self.action} {things}"

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values, only those that this action has; the inverse is `from_record`."""
        said: dict[str, Any] = {}
        for key in ("label", "probability", "name"):
            if getattr(self, key) is not None:
                said[key] = getattr(self, key)
        for key in ("position", "size", "std"):
            if getattr(self, key) is not None:
                said[key] = getattr(self, key).tolist()
        return {
            "number": self.number,
            "action": self.action.value,
            "who": self.who,
            "when": self.when,
            "why": self.why,
            **said,
            "targets": [target.to_dict() for target in self.targets],
        }

    @classmethod
    def from_record(cls, record: JsonRecord) -> Edit:
        """Raises `InputError` where a value is missing or of another kind."""
        action = Action(record.choice("action", tuple(Action)))
        said: dict[str, Any] = {}
        if action is Action.RELABEL:
            said = {"label": record.name("label"), "probability": record.number("probability", 0.0)}
        elif action is Action.MOVE:
            said = {"position": record.vector("position"), "std": record.vector("std", 0.0)}
        elif action is Action.RESIZE:
            said = {"size": record.vector("size", 0.0), "std": record.vector("std", 0.0)}
        elif action is Action.NAME:
            said = {"name": record.text("name")}
        targets = tuple(Target.from_record(target) for target in record.records("targets"))
        with record.explaining():
            if len(targets) < (2 if action is Action.MERGE else 1):
                raise ValueError(f"{len(targets)} targets for {action}")
        texts = {name: record.text(name) for name in ("who", "when", "why")}
        return cls(number=record.count("number"), action=action, targets=targets, **texts, **said)


def _with_std(values: np.ndarray | None, stds: np.ndarray | None) -> str:
    assert values is not None and stds is not None
    return ", ".join(f"{value:.3f}±{std:.3f}" for value, std in zip(values, stds, strict=True))
