"""What an edit does to a thing, its probabilities and covariances included."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..map.thing import Evidence, Thing
from .edit import Action, Edit
from .merged_views import MergedAppearance, MergedViews

ABSENT = 1e-6  # probability of a class that a posterior does not list: below what maps keep


def relabelled(thing: Thing, edit: Edit) -> Thing:
    """The label gets the probability that the edit states, the other classes share the rest as they did before.

    Somebody's word replaces what the detector's scores say, as these were known when it was spoken. Existence stays.
    """
    label, probability = edit.label, edit.probability
    assert label is not None and probability is not None
    others = {name: p for name, p in thing.class_posterior.items() if name != label and p > 0.0}
    total = sum(others.values())
    posterior = {label: probability} | {name: (1.0 - probability) * p / total for name, p in others.items()}
    return replace(thing, label=label, probability=probability, class_posterior=posterior, edits=(*thing.edits, edit))


def moved(thing: Thing, edit: Edit) -> Thing:
    """The centre is where the edit says, with independent errors of the stated std along the map's axes."""
    assert edit.position is not None and edit.std is not None
    covariance = np.diag(edit.std**2)
    return replace(thing, position=edit.position, position_covariance=covariance, edits=(*thing.edits, edit))


def resized(thing: Thing, edit: Edit) -> Thing:
    """The size is what the edit says, with the stated std along the box's own axes; the centre stays."""
    assert edit.size is not None and edit.std is not None
    said = {"size": edit.size, "size_std": edit.std, "volume": None}
    return replace(thing, **said, edits=(*thing.edits, edit))


def named(thing: Thing, edit: Edit) -> Thing:
    """The name is the edit's; nothing else changes."""
    return replace(thing, name=edit.name or None, edits=(*thing.edits, edit))


def merged(things: Sequence[Thing], edit: Edit) -> Thing:
    """Several things that are one; it keeps the first one's id, and the first name that there is.

    - Position and size are the means weighted by information; their covariances are what the weights come to, times
      chi-square over its degrees of freedom where that is above 1 (Birge's ratio): things that lie farther apart than
      their covariances allow give a position as unsure as that.
    - The class posterior is the normalised product: what each says is independent given the class, whose prior is flat.
      Where somebody has said what one of them is, that is what all are: the latest such word stands.
    - It exists unless none of them does: 1 - Π (1 - P).
    - Counts of evidence add; a view that had two of them in the image counts twice.
    """
    first, evidence = things[0], [thing.evidence for thing in things]
    posterior = _said(things) or _product(things)
    label = max(posterior, key=lambda name: (posterior[name], name == first.label))
    position, covariance = _fuse([(thing.position, thing.position_covariance) for thing in things])
    size, size_covariance = _fuse([(thing.size, np.diag(thing.size_std**2)) for thing in things])
    points = [thing.points for thing in things]
    known = [count for count in points if count is not None]
    return replace(
        first,
        label=label,
        probability=posterior[label],
        existence=float(1.0 - np.prod([1.0 - thing.existence for thing in things])),
        class_posterior=posterior,
        position=position,
        position_covariance=covariance,
        size=np.maximum(size, 0.0),
        size_std=np.sqrt(np.diag(size_covariance)),
        yaw=min(things, key=lambda thing: float(np.trace(thing.position_covariance))).yaw,
        first_seen=min(thing.first_seen for thing in things),
        last_seen=max(thing.last_seen for thing in things),
        evidence=Evidence(
            sum(one.supporting for one in evidence),
            sum(one.occluded for one in evidence),
            sum(one.contradicting for one in evidence),
        ),
        views=MergedViews.of(things),
        points=sum(known) if len(known) == len(points) else None,
        volume=None,
        name=next((thing.name for thing in things if thing.name), None),
        edits=(*sorted((e for thing in things for e in thing.edits), key=lambda e: e.number), edit),
        appearance=MergedAppearance.of(things),
    )


def _said(things: Sequence[Thing]) -> dict[str, float] | None:
    """The class posterior of the thing that was relabelled last, None where none was."""
    said = [(e.number, i) for i, thing in enumerate(things) for e in thing.edits if e.action is Action.RELABEL]
    return dict(things[max(said)[1]].class_posterior) if said else None


def _product(things: Sequence[Thing]) -> dict[str, float]:
    names = list(dict.fromkeys(name for thing in things for name in thing.class_posterior))
    log = sum(np.log([max(thing.class_posterior.get(name, 0.0), ABSENT) for name in names]) for thing in things)
    p = np.exp(log - np.max(log))
    return {name: float(value) for name, value in zip(names, p / p.sum(), strict=True)}


def _fuse(estimates: Sequence[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """(3,) mean weighted by information and its (3, 3) covariance, widened by Birge's ratio."""
    floor = 1e-12 * np.eye(3)  # m^2: what is said to be exact is good to a micrometre
    information = [np.linalg.inv(covariance + floor) for _, covariance in estimates]
    covariance = np.linalg.inv(np.sum(information, axis=0))
    mean = covariance @ np.sum([i @ x for i, (x, _) in zip(information, estimates, strict=True)], axis=0)
    square = sum(float((x - mean) @ i @ (x - mean)) for i, (x, _) in zip(information, estimates, strict=True))
    covariance = covariance * max(1.0, square / (3.0 * (len(estimates) - 1)))
    return mean, (covariance + covariance.T) / 2.0
