"""The Markov random field over voxels: time, memory, and how low the energy is.

uv run python benchmarks/mrf.py             100 000 and 500 000 voxels with six labels
uv run python benchmarks/mrf.py --quick     40 000 voxels: whether everything works
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from json import dumps, loads
from pathlib import Path
from typing import TypeVar

import numpy as np
from mrf_world import BACKGROUND, CLASSES, VoxelWorld, build_world
from results import show_section, table
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import maximum_flow

from thingmap.mapper.labelling.alpha_expansion import expand, move_costs
from thingmap.mapper.labelling.dual_bound import bound_energy
from thingmap.mapper.labelling.energy import PottsEnergy
from thingmap.mapper.labelling.max_flow import minimum_cut
from thingmap.mapper.labelling.mean_field import mean_field
from thingmap.mapper.labelling.mrf_config import MrfConfig, Smoothness
from thingmap.mapper.labelling.neighbours import neighbour_pairs
from thingmap.mapper.labelling.pairwise import pair_weights

TITLE = "Random field over voxels"
SIZES, QUICK = (100_000, 500_000), (40_000,)
TERMS = (Smoothness.NORMALS, Smoothness.POTTS)
LIMITS = (10.0, 2000.0)  # s and MB for 500 000 voxels and six labels
FLOW_VOXELS = 100_000  # at most, of the comparison with scipy
T = TypeVar("T")
BOUND_SWEEPS = 20
SCALE = 1000.0  # whole numbers a nat: scipy's capacities are integers


@dataclass(frozen=True, slots=True)
class Solved:
    """One room with one pairwise term. Seconds are of CPU, MB (10^6 bytes) the most that the process ever held."""

    voxels: int
    edges: int
    term: str
    pairs_s: float
    cuts_s: float
    cuts_wall_s: float
    cuts_mb: float
    fast_s: float
    bound_s: float
    cuts_energy: float
    fast_energy: float
    bound: float
    data_f: float
    cuts_f: float
    fast_f: float


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, and write if asked to."""
    options = _options(arguments)
    if options.one:
        print(dumps(asdict(_solve(int(options.one[0]), Smoothness(options.one[1])))))
        return 0
    sizes = QUICK if options.quick else tuple(options.voxels or SIZES)
    solved = [_solve_apart(size, term) for size in sizes for term in TERMS]
    flow_voxels = min(FLOW_VOXELS, *sizes)
    flows = _compare_flow(build_world(flow_voxels))
    show_section(TITLE, describe(solved, flow_voxels, *flows), options.write)
    return 0


def _solve_apart(size: int, term: Smoothness) -> Solved:
    """In a process of its own, so that memory is that of one problem."""
    command = [sys.executable, str(Path(__file__)), "--one", str(size), term.value]
    return Solved(**loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout))


def _solve(size: int, term: Smoothness) -> Solved:
    _warm_up()
    world, config = build_world(size), MrfConfig(smoothness=term)
    edges, pairs_s, _ = _timed(lambda: neighbour_pairs(world.voxels))
    colours = np.zeros_like(world.normals)  # neither term looks at them
    weights = pair_weights(edges, world.voxels, world.points, world.normals, colours, config)
    energy = PottsEnergy(world.unary, edges, weights)
    cuts, cuts_s, cuts_wall_s = _timed(lambda: expand(energy, max_sweeps=config.max_sweeps))
    cuts_mb = _peak_mb()
    fast, fast_s, _ = _timed(lambda: mean_field(energy, config.fast_sweeps).labelling)
    bound, bound_s, _ = _timed(lambda: bound_energy(energy, BOUND_SWEEPS))
    of = [macro_f(labels, world.truth) for labels in (energy.cheapest(), cuts.labels, fast.labels)]
    seconds, energies = (pairs_s, cuts_s, cuts_wall_s, cuts_mb, fast_s, bound_s), (cuts.energy, fast.energy)
    return Solved(energy.nodes, len(edges), term.value, *seconds, *energies, bound.bound, *of)


def _timed(work: Callable[[], T]) -> tuple[T, float, float]:
    """What it gives, seconds of this thread's CPU, seconds by the clock."""
    cpu, wall = time.thread_time(), time.perf_counter()
    result = work()
    return result, time.thread_time() - cpu, time.perf_counter() - wall


def _peak_mb() -> float:
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6


def _warm_up() -> None:
    """Compile, or load what was compiled."""
    edges = neighbour_pairs(np.indices((3, 3, 3)).reshape(3, -1).T.astype(np.int32))
    unary = np.random.default_rng(0).random((27, CLASSES + 1)).astype(np.float32)
    energy = PottsEnergy(unary, edges, np.ones(len(edges), np.float32))
    expand(energy)
    bound_energy(energy, 1)


def macro_f(labels: np.ndarray, truth: np.ndarray) -> float:
    """Mean of the F-scores of the labels that are there, as in figure 4 of Lai et al."""
    scores = []
    for label in np.unique(truth):
        found, true = labels == label, truth == label
        scores.append(2.0 * (found & true).sum() / (found.sum() + true.sum()))
    return float(np.mean(scores))


def _compare_flow(world: VoxelWorld) -> tuple[float, float]:
    """CPU seconds of our maximum flow and scipy's, the same graph of whole numbers, the same flow.

    The graph is that of a first move: any class may take what the data term gives to others.
    """
    _warm_up()
    edges = neighbour_pairs(world.voxels)
    energy = PottsEnergy(world.unary, edges, np.full(len(edges), 2.0, np.float32))
    arcs = energy.arcs()
    real, ends = np.empty(len(arcs.heads)), np.empty(energy.nodes)
    move_costs(energy.unary, edges, energy.weights, energy.cheapest(), 0, real, ends)
    capacity, terminal = np.rint(SCALE * real).astype(np.int64), np.rint(SCALE * ends).astype(np.int64)
    minimum_cut(arcs, capacity.copy(), terminal.copy())  # compiled for whole numbers
    cut, ours, _ = _timed(lambda: minimum_cut(arcs, capacity.copy(), terminal.copy()))
    n, tails = energy.nodes, arcs.heads[np.arange(len(arcs.heads)) ^ 1]
    source, sink = np.flatnonzero(terminal > 0), np.flatnonzero(terminal < 0)
    rows, columns = np.r_[tails, np.full(len(source), n), sink], np.r_[arcs.heads, source, np.full(len(sink), n + 1)]
    values = np.r_[capacity, terminal[source], -terminal[sink]].astype(np.int32)
    graph = csr_matrix((values, (rows, columns)), shape=(n + 2, n + 2))
    result, scipys, _ = _timed(lambda: maximum_flow(graph, n, n + 1))
    if result.flow_value != cut.flow:
        raise AssertionError(f"scipy's flow is {result.flow_value}, ours {cut.flow}")
    return ours, scipys


def describe(solved: Sequence[Solved], flow_voxels: int, ours: float, scipys: float) -> str:
    """Markdown: times and memory, energies, the comparison with scipy, and whether the limits are kept."""
    times = []
    energies = []
    for s in solved:
        seconds = [f"{x:.1f}" for x in (s.cuts_s, s.cuts_wall_s, s.fast_s, s.bound_s)]
        times.append((s.voxels, s.edges, s.term, f"{s.pairs_s:.2f}", *seconds, f"{s.cuts_mb:.0f}"))
        gap, above = (s.cuts_energy - s.bound) / abs(s.bound), s.fast_energy / s.cuts_energy - 1.0
        scores = [f"{x:.3f}" for x in (s.data_f, s.fast_f, s.cuts_f)]
        energies.append((s.voxels, s.term, f"{s.cuts_energy:.0f}", f"{100 * gap:.2f}", f"{100 * above:.1f}", *scores))
    head = ("voxels", "pairs", "term", "pairs, s", "cuts, s", "by the clock, s", "mean field, s", "bound, s", "MB")
    quality = ("voxels", "term", "energy, nats", "above the bound, %", "mean field above cuts, %")
    scores = ("macro F, data alone", "mean field", "cuts")
    kept = [s.cuts_wall_s <= LIMITS[0] and s.cuts_mb <= LIMITS[1] for s in solved]
    return (
        f"A room with things on tables, {CLASSES + 1} labels (the last, {BACKGROUND}, is background), 1 cm voxels. "
        "Seconds are of CPU, one thread; MB the process's peak after the cuts, libraries and the room itself included. "
        f"The bound is that of {BOUND_SWEEPS} sweeps of TRW-S, there and back.\n\n"
        + table(head, times)
        + "\n\n"
        + table((*quality, *scores), energies)
        + f"\n\nMaximum flow of one move among about {flow_voxels} voxels: {1e3 * ours:.0f} ms, scipy's "
        f"`maximum_flow` {1e3 * scipys:.0f} ms ({scipys / ours:.1f} times as long), the same flow.\n\n"
        f"{'All' if all(kept) else 'NOT all'} keep {LIMITS[0]:g} s by the clock and "
        f"{LIMITS[1]:g} MB, asked for 500 000 voxels."
    )


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--voxels", type=int, nargs="+", metavar="N", help="about how many (default 100000 500000)")
    add("--quick", action="store_true", help="a small room only")
    add("--write", action="store_true", help="put the results into RESULTS.md")
    add("--one", nargs=2, help=argparse.SUPPRESS)
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
