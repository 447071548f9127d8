"""What the page says of each thing, as plain values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...map.explanation import REASONS, Explanation, ViewExplanation
from ...map.thing import Thing
from .cameras import Cameras

LISTED_CLASSES = 12  # of a posterior
LEAST_CLASS = 1e-4  # P below which a class is not listed


def thing_values(thing: Thing, R_world_upright: np.ndarray, explanation: Explanation | None, cameras: Cameras) -> dict:
    """A thing: numbers of the map, and geometry in the upright frame; metres, seconds, radians."""
    ranked = sorted(thing.class_posterior.items(), key=lambda item: (-item[1], item[0]))
    covariance = R_world_upright.T @ thing.position_covariance @ R_world_upright
    values = {
        "id": thing.id,
        "label": thing.label,
        "belief": _short(thing.belief(thing.label)),
        "probability": _short(thing.probability),
        "existence": _short(thing.existence),
        "posterior": [[name, _short(p)] for name, p in ranked[:LISTED_CLASSES] if p >= LEAST_CLASS],
        "position": _list(thing.position),
        "position_std": _list(thing.position_std),
        "center": _list(R_world_upright.T @ thing.position),
        "covariance": _list(covariance),
        "size": _list(thing.size),
        "size_std": _list(thing.size_std),
        "yaw": _short(thing.yaw),
        "first_seen": thing.first_seen,
        "last_seen": thing.last_seen,
        "evidence": [thing.evidence.supporting, thing.evidence.occluded, thing.evidence.contradicting],
    }
    if thing.points is not None:
        values["points"] = thing.points
    if thing.volume is not None:
        values |= {"volume_size": _list(thing.volume.size), "volume_size_std": _list(thing.volume.size_std)}
    if thing.name:
        values["name"] = thing.name
    if thing.edits:
        values["edits"] = [
            f"{edit}: {edit.who}, {edit.when}" + (f" – {edit.why}" if edit.why else "") for edit in thing.edits
        ]
    if explanation is not None:
        values["views"] = _views(explanation, cameras)
    return values


def explain(thing: Thing) -> Explanation | None:
    """What its views said, in time order, for its label; None where nothing is on record.

    A thing that a person gave a label of which no class was looked for is explained by its likeliest class that was.

    Raises:
        InputError: the evidence file is damaged or of another map.
    """
    views = thing.views.find() if thing.views is not None else None
    if views is None or not views.classes:
        return None
    known = {name.casefold() for name in views.classes}
    ranked = sorted(thing.class_posterior.items(), key=lambda item: (item[0] != thing.label, -item[1], item[0]))
    label = next((name for name, _ in ranked if name.casefold() in known), views.classes[0])
    return thing.explain(label, in_time_order=True)


def view_names() -> list[dict[str, str]]:
    """What a view's number means: by verdict, what it did and why."""
    return [{"says": says, "why": why} for _, (says, why) in sorted(REASONS.items())]


def _views(explanation: Explanation, cameras: Cameras) -> dict[str, Any]:
    totals: Mapping[Any, int] = explanation.totals
    return {
        "label": explanation.label,
        "summary": explanation.summary(),
        "totals": [totals[verdict] for verdict in sorted(totals)],
        "left_out": explanation.left_out,
        "rows": [_view(view, cameras) for view in explanation.views],
    }


def _view(view: ViewExplanation, cameras: Cameras) -> list[Any]:
    """Stamp, number of the pose or -1, verdict, log ratio, score or None, visible share, frame, sentence."""
    place = cameras.at(view.stamp)
    return [
        round(view.stamp, 6),
        -1 if place is None else cameras.number(place),
        int(view.verdict),
        round(view.log_ratio, 3),
        None if view.score is None else round(view.score, 3),
        round(view.visible["whole"], 3),
        view.frame,
        view.text,
    ]


def _short(value: float) -> float:
    """Six digits: more than anybody reads."""
    return float(f"{value:.6g}")


def _list(values: np.ndarray) -> list[float]:
    return [_short(value) for value in np.asarray(values, dtype=np.float64).ravel()]
