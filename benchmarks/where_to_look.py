"""Does the viewpoint with the largest expected gain teach more than another? Maps of few views and one view more.

uv run python benchmarks/where_to_look.py --write            30 scenes a clutter level, about 15 minutes on two cores
uv run python benchmarks/where_to_look.py --quick            one scene a level, of seeds that are not held out
uv run python benchmarks/where_to_look.py --folder DIR       keeps the rendered scenes there
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from occlusion_bootstrap import CONFIDENCE, DRAWS, draw_scenes
from results import show_section, table
from suite import FIRST_SEED, FRAMES, Scene
from where_to_look_job import DETECTOR, EVERY, START, Job, Tried, run

from thingmap.datasets.errors import UserError
from thingmap.datasets.synthetic.config import ClutterLevel, Preset

TITLE = "Where to look"
SCENES = 30  # of each clutter level
TRIED_SEED = 1  # seeds below `FIRST_SEED` may be looked at while something is built
GAIN, RANDOM = "largest gain", "any (mean)"


def _pick(number: Callable[[Tried], int]) -> Callable[[Tried, tuple[float, ...]], float]:
    return lambda tried, values: values[number(tried)]


POLICIES: dict[str, Callable[[Tried, tuple[float, ...]], float]] = {
    GAIN: _pick(lambda tried: int(np.argmax(tried.gain))),
    RANDOM: lambda tried, values: float(np.mean(values)),
    "nearest": _pick(lambda tried: int(np.argmin(tried.distance))),
    "farthest": _pick(lambda tried: int(np.argmax(tried.distance))),
    "best in hindsight": _pick(lambda tried: int(np.argmin(tried.brier_after))),
}


@dataclass(frozen=True, slots=True)
class Interval:
    """A number and the interval that holds it with probability `CONFIDENCE`, scenes drawn again."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.value:+.3f} ({self.low:+.3f} to {self.high:+.3f})"


def main(arguments: Sequence[str] | None = None) -> int:
    """Render, map, look, judge, show; 2 for a user's mistake."""
    options = _options(arguments)
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.folder or Path(temporary)
        seeds = range(options.first_seed, options.first_seed + options.scenes)
        frames = FRAMES[Preset.SURVEY]
        jobs = [Job(Scene(Preset.SURVEY, level, seed, frames), folder) for seed in seeds for level in ClutterLevel]
        try:
            tried = _run_all(jobs, options.jobs)
        except UserError as error:
            print(f"error: {error}", file=sys.stderr)
            return 2
    show_section(TITLE, describe(tried, options), options.write)
    return 0


def _run_all(jobs: Sequence[Job], workers: int) -> list[Tried]:
    start, tried = time.perf_counter(), []
    if workers == 0:
        return [one for job in jobs for one in run(job)]
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        for number, found in enumerate(pool.imap(run, jobs), start=1):
            tried.extend(found)
            minutes = (time.perf_counter() - start) / 60.0
            print(f"{number}/{len(jobs)} scenes after {minutes:.1f} min", file=sys.stderr, flush=True)
    return tried


def describe(tried: Sequence[Tried], options: argparse.Namespace) -> str:
    """The section's text."""
    seeds = f"seeds {options.first_seed} to {options.first_seed + options.scenes - 1}"
    texts = [
        f"{options.scenes} `survey` scenes a clutter level, {seeds}, detections of `{DETECTOR.format(seed='SEED')}`. "
        f"A map of the first {START} views is asked `where_to_look` about the things (is it there, and what is it) and "
        f"the label of which it is least sure; of the other frames one in {EVERY} is then added, each by itself, to a "
        "map of its own. Bits: entropy of the answer. Brier: squared error of all probabilities, against the truth; "
        "a label's are sums over the map's things. The last view of the first map is what is near or far. Differences "
        f"are to a view chosen at random, with the {CONFIDENCE:.0%} interval of {DRAWS} draws of scenes."
    ]
    for title, about_thing in (("A thing", True), ("A label", False)):
        chosen = [one for one in tried if one.about_thing is about_thing]
        texts.append(f"**{title}**: {len(chosen)} questions.")
        if chosen:
            texts += [policy_table(chosen), agreement(chosen)]
    return "\n\n".join(texts)


def policy_table(tried: Sequence[Tried]) -> str:
    """What every way to choose leaves unknown and wrong."""
    bits, brier = np.mean([one.bits for one in tried]), np.mean([one.brier for one in tried])
    rows = [["no view more", f"{bits:.3f}", "", f"{brier:.3f}", "", ""]]
    for name, choose in POLICIES.items():
        left = np.array([[choose(one, one.bits_after), choose(one, one.brier_after)] for one in tried])
        mean = np.array([[np.mean(one.bits_after), np.mean(one.brier_after)] for one in tried])
        differences = [str(interval(tried, left[:, k] - mean[:, k])) if name != RANDOM else "" for k in (0, 1)]
        ratio = (brier - left[:, 1].mean()) / (brier - mean[:, 1].mean())
        shares = f"{left[:, 0].mean():.3f}", differences[0], f"{left[:, 1].mean():.3f}", differences[1]
        rows.append([name, *shares, f"{ratio:.2f}"])
    return table(("view", "bits", "against random", "Brier", "against random", "Brier saved / random"), rows)


def agreement(tried: Sequence[Tried]) -> str:
    """How well the expected gains tell what views are worth."""
    ranks = [_rank_correlation(np.array(one.gain), one.bits - np.array(one.bits_after)) for one in tried]
    known = np.isfinite(ranks)
    correlation = interval([one for one, k in zip(tried, known, strict=True) if k], np.array(ranks)[known])
    expected = np.mean([np.mean(one.gain) for one in tried])
    came = np.mean([one.bits - np.mean(one.bits_after) for one in tried])
    return (
        f"Expected gain over all views: {expected:.3f} bits; what was gained: {came:.3f} bits. Rank correlation of the "
        f"two within a question, mean of {int(known.sum())} with any gain: {correlation}."
    )


def interval(tried: Sequence[Tried], values: np.ndarray) -> Interval:
    """Mean of one value a question, and its interval by scenes."""
    if not len(tried):
        return Interval(np.nan, np.nan, np.nan)
    names = sorted({one.scene for one in tried})
    scene = np.array([names.index(one.scene) for one in tried])
    weights = draw_scenes(len(names))[:, scene]
    total = weights.sum(axis=1)
    drawn = (weights @ values)[total > 0] / total[total > 0]
    tail = (1.0 - CONFIDENCE) / 2.0
    return Interval(float(values.mean()), *np.quantile(drawn, [tail, 1.0 - tail]).tolist())


def _rank_correlation(a: np.ndarray, b: np.ndarray) -> float:
    """Spearman's; NaN where one of them is the same everywhere."""
    from scipy.stats import rankdata

    x, y = rankdata(a.round(6)), rankdata(b.round(6))
    return float(np.corrcoef(x, y)[0, 1]) if np.ptp(x) > 0 and np.ptp(y) > 0 else np.nan


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--scenes", type=int, metavar="N", help=f"of each clutter level (default {SCENES})")
    add("--first-seed", type=int, metavar="SEED", help=f"of the scenes (default {FIRST_SEED}, those held out)")
    add("--quick", action="store_true", help="one scene a level, not one of those held out; not for RESULTS.md")
    add("--folder", type=Path, metavar="DIR", help="keep rendered scenes there; scenes in it are used again")
    add("--jobs", type=int, default=2, metavar="N", help="at a time, in own processes; 0: in this one (default 2)")
    add("--write", action="store_true", help="put the results into RESULTS.md")
    options = parser.parse_args(arguments)
    few = (1, TRIED_SEED) if options.quick else (SCENES, FIRST_SEED)
    given = options.scenes, options.first_seed
    options.scenes, options.first_seed = (d if g is None else g for g, d in zip(given, few, strict=True))
    if options.scenes < 1 or options.jobs < 0 or options.first_seed < 0:
        parser.error("--scenes counts from 1, --jobs and --first-seed from 0")
    if options.write and (options.scenes < SCENES or options.first_seed != FIRST_SEED):
        parser.error(f"--write is for {SCENES} scenes or more, from seed {FIRST_SEED} on")
    return options


if __name__ == "__main__":
    sys.exit(main())
