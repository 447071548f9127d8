"""Ids that mean the same thing for ever, also once a sequence is mapped again."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from .edit import Edit, Target
from .journal import Entry, Mapped
from .matching import GATE, agree_in_class, distance_squared, mismatch

if TYPE_CHECKING:
    from ..map.object_map import ObjectMap
    from ..map.thing import Thing

NUMBER = re.compile(r"thing-(\d+)")


def known_things(entries: Iterable[Entry], earlier: ObjectMap | None) -> dict[str, Target]:
    """Every id that was ever given, as far as the journal and the map before tell, and whose it is."""
    known: dict[str, Target] = {}
    for entry in entries:
        targets = entry.targets if isinstance(entry, Edit) else entry.gone if isinstance(entry, Mapped) else ()
        known |= {target.id: target for target in targets}
    return known | {thing.id: Target.of(thing) for thing in (earlier.things if earlier else ())}


def keep_ids(object_map: ObjectMap, known: Mapping[str, Target]) -> ObjectMap:
    """The map with the ids of things that are known, and new ids for those that are not.

    A thing keeps its id where it is the known thing of that id, by place and class. Otherwise it takes the id of the
    one known thing that it can be, if it is the only one that can be that. What has the id of something else and is
    nothing known gets a number that nothing ever had.

    Args:
        object_map: just estimated.
        known: id -> the thing that has it.
    """
    ids = {i: thing.id for i, thing in enumerate(object_map.things) if _is(known.get(thing.id), thing)}
    taken = set(ids.values())
    rest = [i for i in range(len(object_map.things)) if i not in ids]
    free = [target for name, target in known.items() if name not in taken]
    ids |= _only_fits(object_map.things, rest, free)
    used = {*known, *ids.values()}
    last = max((_number(name) for name in (*used, *(thing.id for thing in object_map.things))), default=-1)
    for i in rest:
        if i not in ids:
            name = object_map.things[i].id
            if name in used:
                last += 1
                name = f"thing-{last:04d}"
            ids[i] = name
            used.add(name)
    if all(ids[i] == thing.id for i, thing in enumerate(object_map.things)):
        return object_map
    return replace(object_map, things=tuple(replace(thing, id=ids[i]) for i, thing in enumerate(object_map.things)))


def _is(target: Target | None, thing: Thing) -> bool:
    return target is not None and mismatch(target, thing) is None


def _only_fits(things: tuple[Thing, ...], rest: list[int], free: list[Target]) -> dict[int, str]:
    """Position in `things` -> id of the target, where each is the other's only possibility."""
    if not rest or not free:
        return {}
    fits = np.array([[_fits(target, things[i]) for target in free] for i in rest])
    alone = fits & (fits.sum(axis=1, keepdims=True) == 1) & (fits.sum(axis=0, keepdims=True) == 1)
    return {rest[row]: free[column].id for row, column in np.argwhere(alone).tolist()}


def _fits(target: Target, thing: Thing) -> bool:
    return distance_squared(target, thing) <= GATE and agree_in_class(target, thing)


def _number(name: str) -> int:
    match = NUMBER.fullmatch(name)
    return int(match[1]) if match else -1
