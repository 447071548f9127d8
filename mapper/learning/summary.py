"""What was learned, in numbers for people: the table a class, counted detection rates, and what was left out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...datasets.truth import PARTS
from ...factors.existence import ExistenceModel
from ..evaluation.result import Plot, PlotKind, Series, Table
from .calibration import BINS, Calibration
from .learn import Learned
from .samples import Samples, Tally

OCCLUSIONS = (0.0, 0.35, 0.65)  # at which the table gives mean scores: in view, half hidden, near the truncation
POOLED = "all classes"
RATE_BINS = 8  # of the visible share, in which detection rates are counted
LEAST_TRIALS = 30  # in an octave of sizes, for its curve to be shown
KINDS = {  # of evidence, and where `ExistenceModel` keeps their weights
    "scores of detections": "weight_score",
    "found or missed": "weight_rate",
    "seen through": "weight_free",
    "depth at its place": "weight_depth",
    "size": "weight_size",
}


def class_table(learned: Learned, part: int = 0) -> Table:
    """A row a class, and one over all: detections that show it, pairs behind its scores, background, mean scores.

    Detections are those of `part` on objects of the class, whatever they name; pairs (score, occlusion) are those among
    them that name it right, on which the means rest; background detections name it where nothing of it is seen.
    """
    samples, model = learned.samples, learned.model
    found = samples.found & (samples.part == part)
    right = samples.named_right & (samples.part == part)
    rows = []
    for row, name in enumerate((*model.classes, POOLED)):
        own = samples.class_id == learned.class_id[row] if row < len(learned.class_id) else np.ones_like(found)
        means = [float(model.scores.own_parameters(part, occlusion)[0][row]) for occlusion in OCCLUSIONS]
        counts = int((found & own).sum()), int((right & own).sum()), int(learned.background[row, part])
        rows.append((name, *counts, *(round(mean, 3) for mean in means)))
    heads = tuple(f"score at {occlusion:g}" for occlusion in OCCLUSIONS)
    title = "whole objects" if part == 0 else f"{PARTS[part]} halves"
    return Table(title, ("class", "detections", "pairs", "background", *heads), tuple(rows))


def templates(samples: Samples) -> tuple[int, ...]:
    """The templates that found anything."""
    return tuple(int(part) for part in np.unique(samples.part[samples.found]))


@dataclass(frozen=True, slots=True, eq=False)
class SizeRates:
    """P_D of objects of about one size, and what was counted.

    Attributes:
        size_px: geometric mean of their sides.
        share: (101,) visible shares 0, 0.01, ..., 1; and
        curve: (101,) P_D there, of the mixture of classes among the trials.
        visible: (B,) mean visible share of the trials counted together,
        rate: (B,) share of them that was found, and
        trials: (B,) their number, at least 1.
    """

    size_px: float
    share: np.ndarray
    curve: np.ndarray
    visible: np.ndarray
    rate: np.ndarray
    trials: np.ndarray


def size_rates(learned: Learned, rows: np.ndarray, part: int) -> list[SizeRates]:
    """Of the trials rows (T,) of a template, octave by octave of the size; octaves with few trials are left out."""
    samples, found = learned.samples, []
    octave = np.round(np.log2(np.maximum(samples.side_px, 1.0)))
    rows = rows & (samples.part == part) & (samples.visible > 0.0)
    for k in np.unique(octave[rows]):
        near = rows & (octave == k)
        if near.sum() < LEAST_TRIALS:
            continue
        size = float(np.exp(np.log(samples.side_px[near]).mean()))
        share = np.linspace(0.0, 1.0, 101)
        mixture = np.array([(samples.class_id[near] == column).sum() for column in learned.class_id], dtype=np.float64)
        curve = learned.model.detection.probability(share, size, part, np.tile(mixture, (len(share), 1)))
        bin_of = np.minimum((samples.visible[near] * RATE_BINS).astype(int), RATE_BINS - 1)
        trials = np.bincount(bin_of, minlength=RATE_BINS)
        some = trials > 0
        visible = np.bincount(bin_of, samples.visible[near], RATE_BINS)[some] / trials[some]
        rate = np.bincount(bin_of, samples.found[near].astype(np.float64), RATE_BINS)[some] / trials[some]
        found.append(SizeRates(size, share, curve, visible, rate, trials[some]))
    return found


def calibration_table(calibration: Mapping[int, Calibration]) -> Table:
    """A row a template."""
    rows = tuple(
        (PARTS[part], int(c.trials.sum()), round(c.ece, 4), round(c.log_loss, 3), round(c.base_loss, 3))
        for part, c in calibration.items()
    )
    columns = ("template", "trials", "calibration error", "log loss", "log loss of the overall rate")
    return Table("P_D on sequences left out", columns, rows)


def calibration_plot(calibration: Mapping[int, Calibration]) -> Plot:
    """Counted rate over predicted P_D, a series a template; bins with less than 1 % of the trials are left out."""
    diagonal = Series("as predicted", (0.0, 1.0), (0.0, 1.0))
    series = [diagonal]
    for part, c in calibration.items():
        shown = c.trials >= max(c.trials.sum() / (10 * BINS), 1)
        series.append(Series(PARTS[part], tuple(c.predicted[shown]), tuple(c.counted[shown]), PlotKind.POINTS))
    limits = (0.0, 1.0, 0.0, 1.0)
    return Plot("P_D on sequences left out", "predicted", "counted", tuple(series), limits, equal=True)


def weight_table(model: ExistenceModel) -> Table:
    """A row a kind of evidence."""
    rows = tuple((name, round(getattr(model, weight), 3)) for name, weight in KINDS.items())
    return Table("What a kind of evidence counts", ("evidence", "weight"), rows)


def prior_table(model: ExistenceModel) -> Table:
    """What is taken for granted of a landmark before it is looked at, as shares."""
    (found, not_found), (false_found, false_not) = model.object_rate, model.none_rate
    shares = {
        "candidates that are no object": model.null_prior,
        "P_D that an object reaches, on average": found / (found + not_found),
        "P_D that what is none reaches": false_found / (false_found + false_not),
        "objects that look like another class from every side": model.steady_confusion,
        "places without an object where a surface looks like one": model.surface,
        "correlation of one object's scores from view to view": model.score_correlation,
    }
    rows = tuple((name, round(share, 3)) for name, share in shares.items())
    return Table("What is known beforehand", ("of", "share"), rows)


def notes(tally: Tally) -> list[str]:
    """What was left out, a sentence each; the numbers of a person who asks why there is so little."""
    found = [f"{len(names)} frames with {reason} were skipped" for reason, names in tally.skipped.items()]
    if tally.strangers:
        found.append(f"objects of classes that the detector does not have were left out: {_counts(tally.strangers)}")
    if tally.unmeasured:
        found.append(f"objects whose place or size nobody knows were left out: {_counts(tally.unmeasured)}")
    if tally.no_depth:
        found.append(f"{tally.no_depth} times an object was left out of a frame because most of its depth is missing")
    if tally.weak:
        found.append(f"{tally.weak} boxes below the least confidence of the mapper were not looked at")
    if tally.duplicates:
        found.append(f"{tally.duplicates} boxes lie on an object that another one fits better and say nothing")
    if tally.incomplete:
        names = ", ".join(tally.incomplete)
        found.append(f"not every object is known, so boxes beside the known ones are no false detections: {names}")
    return found


def _counts(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{count} {label}" for label, count in sorted(counts.items()))
