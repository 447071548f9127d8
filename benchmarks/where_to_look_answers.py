"""What a map answers to "is it, and what is it?" or "is it a `label`?", what is right, and how much is left open."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from thingmap.datasets.truth import TrueObject
from thingmap.mapper.map.thing import Thing

REACH = 0.25  # of an object's diagonal: how far from its centre a thing may be that stands for it


def answer(thing: Thing | None, label: str | None, classes: Sequence[str]) -> np.ndarray:
    """Probabilities of the answers: "no object" and every class, or "not a `label`" and "a `label`"."""
    if thing is None:  # what the map does not hold any more it does not believe in
        return np.eye(2 if label is not None else len(classes) + 1)[0]
    if label is not None:
        return np.array([1.0 - thing.belief(label), thing.belief(label)])
    own = np.array([thing.class_posterior.get(name, 0.0) for name in classes])
    return np.append(1.0 - thing.existence, thing.existence * own / own.sum())


def right_answer(truth: str | None, label: str | None, classes: Sequence[str]) -> np.ndarray:
    """The same by what the thing stands for: an object's label, or None for no object."""
    if label is not None:
        return np.eye(2)[int(truth == label)]
    return np.eye(len(classes) + 1)[0 if truth is None else 1 + list(classes).index(truth)]


def bits_of(p: np.ndarray) -> float:
    """Entropy."""
    return float(-(p * np.log2(np.where(p > 0.0, p, 1.0))).sum())


def match_truth(things: Sequence[Thing], objects: Sequence[TrueObject]) -> list[str | None]:
    """Label of the object that each thing stands for, the nearest pairs first; None for no object."""
    pairs = sorted(
        (float(np.linalg.norm(thing.position - true.position)), i, j)
        for i, thing in enumerate(things)
        for j, true in enumerate(objects)
    )
    labels: list[str | None] = [None] * len(things)
    taken: set[int] = set()
    for distance, i, j in pairs:
        if labels[i] is None and j not in taken and distance <= REACH * float(np.linalg.norm(objects[j].size)):
            labels[i] = objects[j].label
            taken.add(j)
    return labels
