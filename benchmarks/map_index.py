"""How fast a map answers `nearest`, `within` and `find`, against going through all its things.

uv run python benchmarks/map_index.py            maps of 100 to 100,000 things
uv run python benchmarks/map_index.py --write    and put the table into RESULTS.md

Things lie three a square metre on floors of rooms 3 m high, 10 floors at most, in 80 classes. Answers of the index are
compared with the exhaustive ones on the way. Times are of single calls, a different place or label each, after every
label was asked for once; the first call of each kind, which makes what the index keeps, is given apart, and so is the
first call for a label. SQLite's R*Tree is asked for the same boxes.
"""

from __future__ import annotations

import argparse
import sqlite3
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from results import show_section, table

from thingmap.mapper.map.object_map import MapFrame, ObjectMap
from thingmap.mapper.map.region import Ball, Box, probability_inside
from thingmap.mapper.map.thing import Evidence, Thing
from thingmap.mapper.map.up_direction import UpDirection
from thingmap.mapper.queries.answer import PROBABLE, Answer

TITLE = "Index of a map"
SIZES = (100, 1_000, 10_000, 100_000)
DENSITY, FLOORS, STOREY = 3.0, 10, 3.0  # things a square metre; floors; metres
CLASSES = tuple(f"class {k:02d}" for k in range(80))
CALLS = 300
EXHAUSTIVE_CALLS, MANY = 3, 5_000  # one of maps of more things than that: going through 100,000 takes minutes
REACH = 1.0  # metres: half a side of the boxes, radius of the balls
COUNT = 10  # of `nearest`


@dataclass(frozen=True, slots=True, eq=False)
class Question:
    """One kind of question: what the map answers, and the same by going through all things."""

    name: str
    ask: Callable[[ObjectMap, Any], list[Answer]]
    exhaustively: Callable[[ObjectMap, Any], list[tuple[str, float]]]
    about: Callable[[np.random.Generator, ObjectMap], Any]


@dataclass(frozen=True, slots=True, eq=False)
class Times:
    """Of one question to one map, milliseconds: first call, median, 95th percentile, median of the exhaustive answer;
    and the median number of answers."""

    first: float
    median: float
    p95: float
    exhaustive: float
    answers: float


def made_up_map(count: int, seed: int = 0) -> ObjectMap:
    """Things as a mapper leaves them: some centimetres unsure, likeliest of one class, perhaps of two others."""
    rng = np.random.default_rng(seed)
    side = np.sqrt(count / DENSITY / FLOORS) if count > 1000 else np.sqrt(count / DENSITY)
    floors = FLOORS if count > 1000 else 1
    return ObjectMap(
        tuple(_thing(number, rng, side, floors) for number in range(count)),
        CLASSES,
        f"{count} made up things",
        MapFrame.DATASET,
        UpDirection(np.array([0.0, 0.0, 1.0]), 0.01, "planes"),
    )


def _thing(number: int, rng: np.random.Generator, side: float, floors: int) -> Thing:
    names = rng.choice(len(CLASSES), 3, replace=False)
    posterior = rng.dirichlet([8.0, 1.0, 0.5])
    factor = rng.normal(scale=0.02, size=(3, 3))
    best = int(np.argmax(posterior))
    height = STOREY * rng.integers(floors) + rng.uniform(0.0, 2.0)
    return Thing(
        id=f"thing-{number:04d}",
        label=CLASSES[names[best]],
        probability=float(posterior[best]),
        existence=float(rng.uniform(0.5, 1.0)),
        class_posterior={CLASSES[k]: float(p) for k, p in zip(names, posterior, strict=True)},
        position=np.array([*rng.uniform(0.0, side, 2), height]),
        position_covariance=factor @ factor.T,
        size=rng.uniform(0.05, 0.5, 3),
        size_std=np.full(3, 0.01),
        yaw=0.0,
        first_seen=0.0,
        last_seen=1.0,
        evidence=Evidence(5, 2, 1),
    )


def _place(rng: np.random.Generator, object_map: ObjectMap) -> np.ndarray:
    return object_map.things[rng.integers(len(object_map))].position + rng.normal(scale=0.5, size=3)


def _box(rng: np.random.Generator, object_map: ObjectMap) -> Box:
    place = _place(rng, object_map)
    return Box(place - REACH, place + REACH)


def _ball(rng: np.random.Generator, object_map: ObjectMap) -> Ball:
    return Ball(_place(rng, object_map), REACH)


def _label(rng: np.random.Generator, object_map: ObjectMap) -> str:
    return CLASSES[rng.integers(len(CLASSES))]


def _all_near(object_map: ObjectMap, place: np.ndarray) -> list[tuple[str, float]]:
    asked = [thing for thing in object_map.things if thing.existence >= PROBABLE]
    ranked = sorted(asked, key=lambda thing: (float(np.linalg.norm(thing.position - place)), thing.id))
    return [(thing.id, thing.existence) for thing in ranked[:COUNT]]


def _all_within(object_map: ObjectMap, region: Box | Ball) -> list[tuple[str, float]]:
    known = ((thing, thing.existence) for thing in object_map.things if thing.existence >= PROBABLE)
    found = ((t, p * probability_inside(region, t.position, t.position_covariance)) for t, p in known)
    return sorted(((t.id, p) for t, p in found if p >= PROBABLE), key=lambda one: (-one[1], one[0]))


def _all_called(object_map: ObjectMap, label: str) -> list[tuple[str, float]]:
    found = ((thing.id, thing.belief(label)) for thing in object_map.things)
    return sorted(((name, p) for name, p in found if p > 0.0), key=lambda one: (-one[1], one[0]))


QUESTIONS = (
    Question(f"nearest, {COUNT}", lambda m, place: m.nearest(place, count=COUNT), _all_near, _place),
    Question("within a box", lambda m, region: m.within(region), _all_within, _box),
    Question("within a ball", lambda m, region: m.within(region), _all_within, _ball),
    Question("find", lambda m, label: m.find(label), _all_called, _label),
)


def measure(question: Question, object_map: ObjectMap, calls: int, exhaustive_calls: int) -> Times:
    """Times of one question; raises `AssertionError` where an answer is not the exhaustive one."""
    rng = np.random.default_rng(1)
    first, _ = _timed(lambda: question.ask(object_map, question.about(rng, object_map)))
    times, answers, slow = [], [], []
    if question.about is _label:
        for label in CLASSES:
            question.ask(object_map, label)
    for call in range(calls):
        about = question.about(rng, object_map)
        cost, found = _timed(lambda about=about: question.ask(object_map, about))
        times.append(cost)
        answers.append(len(found))
        if call < exhaustive_calls:
            cost, wanted = _timed(lambda about=about: question.exhaustively(object_map, about))
            slow.append(cost)
            _compare(found, wanted)
    median, p95 = np.percentile(times, [50, 95]).tolist()
    return Times(first, median, p95, float(np.median(slow)), float(np.median(answers)))


def _compare(found: list[Answer], wanted: list[tuple[str, float]]) -> None:
    """The same things; integrals are within 0.002, so that of what is that close to the limit either is right."""
    probability = {answer.thing.id: answer.probability for answer in found}
    for name, p in wanted:
        assert abs(probability.pop(name, PROBABLE) - p) < 0.004, f"{name}: {p} in the exhaustive answer"
    assert all(abs(p - PROBABLE) < 0.004 for p in probability.values()), f"{probability} are no answers"


def _timed(work: Callable[[], Any]) -> tuple[float, Any]:
    start = time.perf_counter()
    result = work()
    return 1e3 * (time.perf_counter() - start), result


def rtree_ms(object_map: ObjectMap, calls: int) -> tuple[float, float]:
    """Milliseconds in which SQLite's R*Tree is filled, and in which it names the things in a box (median), nothing said
    of their probability."""
    base, rng = sqlite3.connect(":memory:"), np.random.default_rng(1)
    base.execute("create virtual table places using rtree(id, x0, x1, y0, y1, z0, z1)")
    rows = ((n, *np.repeat(thing.position, 2).tolist()) for n, thing in enumerate(object_map.things))
    filling, _ = _timed(lambda: base.executemany("insert into places values (?, ?, ?, ?, ?, ?, ?)", rows))
    ask = "select id from places where x0 >= ? and x1 <= ? and y0 >= ? and y1 <= ? and z0 >= ? and z1 <= ?"
    costs = []
    for _ in range(calls):
        box = _box(rng, object_map)
        limits = np.stack([box.low, box.high], axis=1).ravel().tolist()
        costs.append(_timed(lambda limits=limits: base.execute(ask, limits).fetchall())[0])
    base.close()
    return filling, float(np.median(costs))


def candidates_ms(object_map: ObjectMap, calls: int) -> tuple[float, float]:
    """The same of this index: places of things in a box, before anything is said of their probability."""
    index, rng = object_map.index, np.random.default_rng(1)
    filling, asked = _timed(lambda: index._asked(None, PROBABLE))
    boxes = [_box(rng, object_map) for _ in range(calls)]
    return filling, float(
        np.median([_timed(lambda box=box: index._places_within(box, asked, PROBABLE))[0] for box in boxes])
    )


def files_s(object_map: ObjectMap) -> tuple[float, float]:
    """Seconds to save and to load."""
    with tempfile.TemporaryDirectory() as folder:
        save, file = _timed(lambda: object_map.save(Path(folder)))
        load, _ = _timed(lambda: ObjectMap.load(file))
    return save / 1e3, load / 1e3


def rows_of(count: int, calls: int, exhaustive_calls: int) -> Iterator[tuple[object, ...]]:
    """Rows of the table for one map."""
    object_map = made_up_map(count)
    for question in QUESTIONS:
        t = measure(question, object_map, calls, exhaustive_calls if count <= MANY else 1)
        numbers = f"{t.median:.3f}", f"{t.p95:.3f}", f"{t.first:.1f}", f"{t.exhaustive:.3g}"
        yield f"{count:,}", question.name, f"{t.answers:g}", *numbers, f"{t.exhaustive / t.median:.0f}"


def describe(sizes: Sequence[int], calls: int, exhaustive_calls: int) -> str:
    """Markdown."""
    head = ("things", "question", "answers", "median ms", "95 % ms", "first call ms", "exhaustive ms", "ratio")
    rows = [row for size in sizes for row in rows_of(size, calls, exhaustive_calls)]
    largest = made_up_map(max(sizes))
    save, load = files_s(largest)
    (filled, named), (tree_filled, tree_named) = candidates_ms(largest, calls), rtree_ms(largest, calls)
    return (
        f"{calls} calls each, with the default arguments (`nearest` with count={COUNT}); the exhaustive answer in the "
        f"same run, {exhaustive_calls} calls, one of maps of more than {MANY:,} things.\n\n{table(head, rows)}\n\n"
        f"Of {max(sizes):,} things, those in a box of {2 * REACH:g} m are named in {named:.3f} ms (median) by the "
        f"index, whose sorted arrays were made in {filled:.0f} ms, and in {tree_named:.3f} ms by SQLite's R*Tree, "
        f"which was filled in {tree_filled:.0f} ms. Saving that map takes {save:.1f} s, loading it {load:.1f} s."
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, and write if asked to."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=int, nargs="+", default=SIZES, metavar="N", help="things of the maps")
    parser.add_argument("--calls", type=int, default=CALLS, metavar="N", help=f"of each question (default {CALLS})")
    parser.add_argument("--write", action="store_true", help="put the results into RESULTS.md")
    options = parser.parse_args(arguments)
    if min(options.sizes) < 1 or options.calls < 1:
        parser.error("--sizes and --calls count from 1")
    text = describe(options.sizes, options.calls, min(EXHAUSTIVE_CALLS, options.calls))
    show_section(TITLE, text, options.write)
    return 0


if __name__ == "__main__":
    sys.exit(main())
