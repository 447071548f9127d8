"""Tables of the occlusion benchmark: what each method found, the full model's lead, and whether it is calibrated."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
from occlusion_bootstrap import Difference, Measured, mean_difference
from occlusion_methods import DETECTOR_ALONE, FULL, JUDGED, METHODS, NO_OCCLUSION, NO_PARTS, Claims, Method
from results import table

from thingmap.datasets.synthetic.config import ClutterLevel
from thingmap.mapper.evaluation.uncertainty.calibration import bin_claims, calibrate_outcomes

METRICS = ("recall at 1 FPPI", "average precision")  # columns of `Measured.value`
SHOWN = (4, 7, 12)  # numbers of views of plots and of tables by class
ENOUGH = 4  # views from which on the full model is to lead (Explicit Occlusion, section 5.3)
WANTED_LEAD = 0.10  # of recall over the detector alone, in high clutter
WANTED_ECE = 0.05
ROUNDING = 1e-9
RIVALS = ("detector", "no-occlusion", "no-depth", "no-parts")
Results = Mapping[str, Mapping[int, Measured]]  # by method and number of views


def titles(results: Results) -> dict[str, str]:
    """Of the methods that there are, in the order of `METHODS`."""
    return {method.name: method.title for method in METHODS if method.name in results}


def metric_tables(results: Results) -> str:
    """Views by methods: a table a metric."""
    views = sorted({n for by_views in results.values() for n in by_views})
    names = titles(results)
    texts = []
    for metric, title in enumerate(METRICS):
        rows = [[n, *(_share(results[name].get(n), metric) for name in names)] for n in views]
        texts.append(f"{title[0].upper()}{title[1:]}:\n\n{table(['views', *names.values()], rows)}")
    return "\n\n".join(texts)


def class_table(by_class: Mapping[str, Results]) -> str:
    """Average precision by class, of the full model and of the detector alone."""
    pair = [method for method in (FULL, DETECTOR_ALONE) if all(method.name in results for results in by_class.values())]
    head = ["average precision", *(f"{method.title}, {n}" for n in SHOWN for method in pair)]
    rows = [
        [label, *(_share(results[method.name].get(n), 1) for n in SHOWN for method in pair)]
        for label, results in by_class.items()
    ]
    return table(head, rows)


def difference_tables(results: Results) -> str:
    """The full model less each rival in points, by number of views: a table a metric."""
    names, texts = titles(results), []
    rivals = [name for name in RIVALS if name in results]
    views = sorted(results[FULL.name])
    for metric, title in enumerate(METRICS):
        rows = [[n, *(_points(_lead(results, name, metric, [n])) for name in rivals)] for n in views]
        head = ["views", *(f"full - {names[name]}" for name in rivals)]
        texts.append(f"Lead of the full model in points of {title}:\n\n{table(head, rows)}")
    return "\n\n".join(texts)


def summary_table(levels: Mapping[ClutterLevel, Results]) -> str:
    """The full model's lead by clutter: its mean over all numbers of views from `ENOUGH` on."""
    rows = []
    for metric, title in enumerate(METRICS):
        for name in RIVALS:
            if all(name in results for results in levels.values()):
                cells = [_summary(results, name, metric) for results in levels.values()]
                rows.append([title, f"full - {titles(next(iter(levels.values())))[name]}", *cells])
    return table(["points of", "", *(f"{level} clutter" for level in levels)], rows)


def verdict_table(levels: Mapping[ClutterLevel, Results]) -> str:
    """Whether the papers' order appears, statement by statement."""
    rows = []
    for metric, title in enumerate(METRICS):
        rows += [[text, title, *found] for text, found in _verdicts(levels, metric)]
    lead = _mean_lead(levels.get(ClutterLevel.HIGH, {}), DETECTOR_ALONE, 0)
    if lead is not None:
        wanted = f"at least {100 * WANTED_LEAD:.0f} points above (a) in high clutter"
        rows.append([wanted, METRICS[0], _points(lead), _yes(lead.value >= WANTED_LEAD)])
    return table(["to be shown", "of", "measured", "so"], rows)


def calibration_table(claims: Mapping[str, Sequence[Claims]]) -> str:
    """Errors of what final maps claim, by group of scenes: all claims of a group together."""
    head = [
        "clutter",
        "scenes",
        "things",
        "existence ECE",
        "Brier",
        "matched",
        "class ECE",
        f"ECE at most {WANTED_ECE}",
    ]
    rows = []
    for group, several in claims.items():
        existence, stands, probability, right = _together(several)
        of_existence = calibrate_outcomes(existence, stands, JUDGED.calibration_bins)
        of_class = bin_claims(probability, right, JUDGED.calibration_bins).expected_error
        errors = of_existence.reliability.expected_error, of_class
        good = _yes(all(error <= WANTED_ECE for error in errors))
        numbers = [f"{errors[0]:.3f}", f"{of_existence.brier:.3f}", len(probability), f"{errors[1]:.3f}"]
        rows.append([group, len(several), len(existence), *numbers, good])
    return table(head, rows)


def reliability_table(several: Sequence[Claims]) -> str:
    """Claimed against observed by bins, of existence and of the likeliest class."""
    bins = JUDGED.calibration_bins
    existence, stands, probability, right = _together(several)
    kinds = bin_claims(existence, stands, bins), bin_claims(probability, right, bins)
    rows = []
    for k in range(bins):
        cells = [_bin(kind.count[k], kind.claimed[k], kind.observed[k]) for kind in kinds]
        rows.append([f"{k / bins:.1f} to {(k + 1) / bins:.1f}", *cells[0], *cells[1]])
    kind_head = [f"{of}: {what}" for of in ("existence", "class") for what in ("claims", "claimed", "observed")]
    return table(["probability", *kind_head], rows)


def cost_line(seconds: Iterable[Mapping[str, float]], jobs: int) -> str:
    """Mean seconds a scene by stage."""
    readings: dict[str, list[float]] = {}
    for one in seconds:
        for stage, value in one.items():
            readings.setdefault(stage, []).append(value)
    means = ", ".join(f"{stage} {np.mean(values):.1f}" for stage, values in readings.items())
    return f"Mean seconds a scene, {jobs} at a time: {means}."


def _verdicts(levels: Mapping[ClutterLevel, Results], metric: int) -> Iterable[tuple[str, list[str]]]:
    """What is said of every metric: the statement, what was measured, and whether it is so."""
    if all(DETECTOR_ALONE.name in results for results in levels.values()):
        behind = [
            f"{level} {n}"
            for level, results in levels.items()
            for n in _views(results)
            if not _lead(results, DETECTOR_ALONE.name, metric, [n]).value > 0.0
        ]
        measured = "at every number of views" if not behind else "not at " + ", ".join(behind) + " views"
        yield f"above (a) from {ENOUGH} views on", [measured, _yes(not behind)]
    for method in (NO_OCCLUSION, NO_PARTS):
        leads = [_mean_lead(results, method, metric) for results in levels.values()]
        known = dict(zip(levels, leads, strict=True))
        for level in (ClutterLevel.MEDIUM, ClutterLevel.HIGH):
            if (lead := known.get(level)) is not None:
                so = "yes" if lead.sure else "not beyond chance" if lead.value > 0.0 else "no"
                yield f"above {method.title} in {level} clutter", [_points(lead), so]
        if len(leads) == len(ClutterLevel) and (values := [lead.value for lead in leads if lead is not None]):
            measured = ", ".join(f"{100 * value:+.1f}" for value in values)
            yield f"above {method.title} by more as clutter grows", [measured, _yes(all(np.diff(values) > ROUNDING))]


def _mean_lead(results: Results, rival: Method, metric: int) -> Difference | None:
    return _lead(results, rival.name, metric, _views(results)) if rival.name in results else None


def _lead(results: Results, rival: str, metric: int, views: Sequence[int]) -> Difference:
    both = [n for n in views if n in results[rival]]
    return mean_difference([results[FULL.name][n] for n in both], [results[rival][n] for n in both], metric)


def _views(results: Results) -> list[int]:
    return [n for n in sorted(results[FULL.name]) if n >= ENOUGH]


def _summary(results: Results, rival: str, metric: int) -> str:
    views = _views(results)
    ahead = sum(_lead(results, rival, metric, [n]).value > 0.0 for n in views)
    return f"{_points(_lead(results, rival, metric, views))}, ahead at {ahead} of {len(views)}"


def _together(several: Sequence[Claims]) -> list[np.ndarray]:
    fields: list[Callable[[Claims], np.ndarray]] = [
        lambda claims: claims.existence,
        lambda claims: claims.stands.astype(bool),
        lambda claims: claims.probability,
        lambda claims: claims.right.astype(bool),
    ]
    return [np.concatenate([field(claims) for claims in several]) for field in fields]


def _bin(count: int, claimed: float, observed: float) -> list[object]:
    return [int(count), f"{claimed:.2f}", f"{observed:.2f}"] if count else [0, "-", "-"]


def _share(measured: Measured | None, metric: int) -> str:
    return "-" if measured is None or not np.isfinite(measured.value[metric]) else f"{measured.value[metric]:.3f}"


def _points(lead: Difference) -> str:
    return f"{100 * lead.value:+.1f} [{100 * lead.low:+.1f}, {100 * lead.high:+.1f}]"


def _yes(so: bool) -> str:
    return "yes" if so else "no"
