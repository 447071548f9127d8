"""How long shape contexts and their matching take, and what approximate matching would miss.

OMP_NUM_THREADS=1 uv run python benchmarks/shape_context_matching.py --write

Codebooks and queries are descriptors of rendered tabletops: codebooks of points on objects of known class that see only
their own object, as in training images; queries of other scenes' points that see only their own proposal.
Times are the least milliseconds of CPU, of all threads together; what is compared takes turns in one run.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numba import njit
from proposal_truth import rendered
from results import show_section, table

from thingmap.datasets.frame import Frame
from thingmap.datasets.synthetic.synth import open_synth
from thingmap.detectors.proposals.proposals import find_proposals
from thingmap.detectors.shape_context.descriptor import shape_contexts
from thingmap.detectors.shape_context.edge_map import EdgeMap
from thingmap.detectors.shape_context.edges import find_edges
from thingmap.detectors.shape_context.matching import best_matches
from thingmap.detectors.shape_context.sampling import edge_owners

TITLE = "Shape contexts, speed of matching"
SCENE = "synth:tabletop?clutter=medium&seed="
CODEBOOK_SEEDS, QUERY_SEEDS, FRAMES = range(1500, 1504), range(1504, 1506), 6
CLASSES, NEAREST, RADIUS = 6, 10, 0.1  # classes searched, K, metres
SIZES = ((600, 1500), (600, 4000), (1000, 1500), (1000, 4000))  # queries, entries of each class
PRESELECTED = (10, 20, 30, 50)
POINTS, DESCRIBED = 20_000, 1000  # of an edge map; of one image


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, and write if asked to."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=7, metavar="N", help="of every measurement (default 7)")
    parser.add_argument("--write", action="store_true", help="put the results into RESULTS.md")
    options = parser.parse_args(arguments)
    if options.repeats < 1:
        parser.error("--repeats counts from 1")
    codebooks, (queries, frame) = class_codebooks(), image_queries()
    texts = descriptor_table(frame, options.repeats), matching_table(codebooks, queries, options.repeats)
    show_section(TITLE, "\n\n".join(texts), options.write)
    return 0


def class_codebooks() -> list[np.ndarray]:
    """Of each class up to the most entries of `SIZES`, in random order."""
    rng, most = np.random.default_rng(0), max(entries for _, entries in SIZES)
    found: dict[str, list[np.ndarray]] = {}
    for seed in CODEBOOK_SEEDS:
        labels = {thing.id: thing.label for thing in open_synth(f"{SCENE}{seed}").objects}
        for _, frame, instances, _ in rendered([f"{SCENE}{seed}"], FRAMES):
            edges, owner, points, radius = usable(frame, np.where(np.isin(instances, list(labels)), instances, -1))
            rows = shape_contexts(edges, points, radius, owner)
            for thing in np.unique(owner[points]).tolist():
                found.setdefault(labels[thing], []).append(rows[owner[points] == thing])
    all_rows = sorted((np.concatenate(rows) for rows in found.values()), key=len)[-CLASSES:]
    return [rows[rng.permutation(len(rows))[:most]] for rows in all_rows]


def image_queries() -> tuple[np.ndarray, Frame]:
    """(Q, LENGTH) descriptors of several images in random order, and one of the images."""
    rng, rows, frame = np.random.default_rng(1), [], None
    for _, frame, _, _ in rendered([f"{SCENE}{seed}" for seed in QUERY_SEEDS], FRAMES):
        edges, owner, points, radius = usable(frame, find_proposals(frame).labels)
        some = rng.permutation(len(points))[:DESCRIBED]
        rows.append(shape_contexts(edges, points[some], radius[some], owner))
    assert frame is not None
    return rng.permutation(np.concatenate(rows)), frame


def usable(frame: Frame, labels: np.ndarray) -> tuple[EdgeMap, np.ndarray, np.ndarray, np.ndarray]:
    """Edges of a frame, their owners, the points with owner and depth, and the pixels of `RADIUS` there."""
    edges = find_edges(frame.color, frame.depth)
    owner = edge_owners(edges, labels.astype(np.int32), frame.depth)
    points = np.flatnonzero((owner >= 0) & (edges.depth > 0.0))
    return edges, owner, points, (RADIUS * frame.intrinsics.fx / edges.depth[points]).astype(np.float32)


def descriptor_table(frame: Frame, repeats: int) -> str:
    """Markdown: milliseconds for `DESCRIBED` points by radius, among random points and in a rendered frame."""
    rng = np.random.default_rng(2)
    real = find_edges(frame.color, frame.depth)
    rows, columns = np.divmod(np.sort(rng.choice(640 * 480, POINTS, replace=False)), 640)
    start, there = np.searchsorted(rows, np.arange(481)).astype(np.int64), np.ones(POINTS, dtype=np.float32)
    orientation = rng.uniform(0.0, 3.14, POINTS).astype(np.float32)
    random = EdgeMap((480, 640), columns.astype(np.int32), rows.astype(np.int32), start, orientation, there, there > 0)
    lines = []
    for radius in (20, 40, 80, 120):
        works = [
            partial(shape_contexts, e, rng.choice(len(e), DESCRIBED), np.full(DESCRIBED, radius, np.float32))
            for e in (random, real)
        ]
        lines.append((radius, *(f"{ms:.1f}" for ms in least_ms(works, repeats))))
    head = ("radius, px", f"{POINTS} random points, ms", f"a rendered frame, {len(real)} points, ms")
    return f"Describing {DESCRIBED} points of an edge map, one core:\n\n" + table(head, lines)


def matching_table(codebooks: list[np.ndarray], queries: np.ndarray, repeats: int) -> str:
    """Markdown: milliseconds for all classes by the numbers of queries and entries, and recall of the K nearest."""
    ways = {"`best_matches`, exact": lambda a, b: best_matches(a, b, NEAREST)[0], "exact, by the definition": plain}
    for count in PRESELECTED:
        name = "Hellinger alone" if count == NEAREST else f"best {count} by Hellinger, then chi-square"
        ways[name] = partial(preselected, count=count)
    cells: dict[str, list[str]] = {name: [] for name in ways}
    for asked, entries in SIZES:
        some, books = queries[:asked], [rows[:entries] for rows in codebooks]
        works = [lambda way=way, q=some, c=books: [way(q, b) for b in c] for way in ways.values()]
        times = least_ms(works, repeats)
        for name, ms in zip(ways, times, strict=True):
            cells[name].append(f"{ms:.0f} ({ms / times[0]:.2f})")
    exact = [plain(queries, rows) for rows in codebooks]
    lines = []
    for name, way in ways.items():
        found = [way(queries, rows) for rows in codebooks]
        lines.append((name, *cells[name], f"{recall(exact, found):.3f}"))
    return (
        f"Matching to {len(codebooks)} classes one after the other, one core, ms (times the first way's): queries x "
        f"entries of each class. Recall of the {NEAREST} nearest by {len(queries)} queries; of the "
        f"{queries.shape[1]} bins of a query {(queries > 0).sum(axis=1).mean():.0f} are filled:\n\n"
        + table(("way", *(f"{a} x {b}" for a, b in SIZES), "recall"), lines)
    )


def recall(exact: list[np.ndarray], found: list[np.ndarray]) -> float:
    """Share of the true nearest that were found."""
    both = [(a[:, :, None] == b[:, None, :]).any(axis=2).mean() for a, b in zip(exact, found, strict=True)]
    return float(np.mean(both))


def plain(queries: np.ndarray, codebook: np.ndarray) -> np.ndarray:
    """(S, NEAREST) the best by chi-square as it is defined."""
    return rerank(queries, codebook, np.broadcast_to(np.arange(len(codebook)), (len(queries), len(codebook))), NEAREST)


def preselected(queries: np.ndarray, codebook: np.ndarray, count: int) -> np.ndarray:
    """(S, NEAREST) the best by chi-square of the `count` entries whose square roots' products are largest."""
    likeness = np.sqrt(queries) @ np.sqrt(codebook).T
    best = largest(likeness, count)
    return best if count == NEAREST else rerank(queries, codebook, best, NEAREST)


@njit
def largest(values: np.ndarray, count: int) -> np.ndarray:
    """(S, count) indices of the largest of every row, largest first."""
    result, best = np.zeros((len(values), count), dtype=np.int64), np.empty(count, dtype=np.float32)
    for i in range(len(values)):
        best[:] = -np.inf
        for j in range(values.shape[1]):
            if values[i, j] > best[count - 1]:
                p = count - 1
                while p > 0 and best[p - 1] < values[i, j]:
                    best[p], result[i, p] = best[p - 1], result[i, p - 1]
                    p -= 1
                best[p], result[i, p] = values[i, j], j
    return result


@njit(error_model="numpy", fastmath={"reassoc", "nsz", "nnan"})
def rerank(queries: np.ndarray, codebook: np.ndarray, candidates: np.ndarray, count: int) -> np.ndarray:
    """(S, count) the nearest by chi-square of each query's candidates (S, C), nearest first."""
    result, best = np.zeros((len(queries), count), dtype=np.int64), np.empty(count, dtype=np.float32)
    for i in range(len(queries)):
        best[:] = np.float32(9.0)
        for entry in candidates[i]:
            distance = np.float32(0.0)
            for b in range(queries.shape[1]):
                difference = queries[i, b] - codebook[entry, b]
                distance += difference * difference / (queries[i, b] + codebook[entry, b] + np.float32(1e-30))
            if distance < best[count - 1]:
                p = count - 1
                while p > 0 and best[p - 1] > distance:
                    best[p], result[i, p] = best[p - 1], result[i, p - 1]
                    p -= 1
                best[p], result[i, p] = distance, entry
    return result


def least_ms(works: Sequence[Callable[[], object]], repeats: int) -> list[float]:
    """Least milliseconds of CPU of each, all in turn."""
    costs = np.full((repeats + 1, len(works)), np.inf)
    for round_, line in enumerate(costs):
        for number, work in enumerate(works):
            start = time.process_time()
            work()
            line[number] = 1e3 * (time.process_time() - start) if round_ else np.inf  # the first compiles
    return costs.min(axis=0).tolist()


if __name__ == "__main__":
    sys.exit(main())
