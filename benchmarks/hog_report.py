"""Tables of the HOG benchmark."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise

import numpy as np
from hog_job import JudgedScene, Sights
from results import table

from thingmap.datasets.synthetic.things.models import CLASSES
from thingmap.detectors.detections import Part
from thingmap.mapper.evaluation.boxes.curves import Scored, average_precision, counts
from thingmap.mapper.evaluation.boxes.matching import Matches, scored

FALSE_PER_IMAGE = 1.0  # at which recalls are compared
BINS = (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0)  # of occlusion
GONE = 0.5  # a half more hidden than this counts as gone
SEEN = 0.01  # a half less hidden than this counts as seen: a few percent of it hidden cost more than all of the other
FEWEST = 20  # objects; the mean of fewer is not shown
OPPOSITE = {Part.TOP: Part.BOTTOM, Part.BOTTOM: Part.TOP, Part.LEFT: Part.RIGHT, Part.RIGHT: Part.LEFT}

Groups = Mapping[str, Mapping[str, Sequence[JudgedScene]]]  # group of scenes -> model -> what it made of them


def all_matches(judged: Iterable[JudgedScene], part: Part = Part.WHOLE) -> list[Matches]:
    """Of all frames of all scenes."""
    return [match for scene in judged for match in scene.matches[part]]


def class_precisions(matches: Sequence[Matches], classes: Sequence[str]) -> dict[str, float | None]:
    """Average precision of each class; None where no object of it was to be found."""
    return {label: average_precision(scored(matches, number)) for number, label in enumerate(classes)}


def mean_precision(matches: Sequence[Matches], classes: Sequence[str]) -> float | None:
    """Mean over the classes that there were."""
    known = [value for value in class_precisions(matches, classes).values() if value is not None]
    return float(np.mean(known)) if known else None


def precision_table(groups: Groups, classes: Sequence[str] = CLASSES) -> str:
    """A row a class and group: average precision of every model."""
    models = list(next(iter(groups.values())))
    rows = []
    for group, by_model in groups.items():
        matches = {name: all_matches(by_model[name]) for name in models}
        by_class = {name: class_precisions(matches[name], classes) for name in models}
        objects = {label: _fair(matches[models[0]], number) for number, label in enumerate(classes)}
        rows += [
            (group, label, objects[label], *(_number(by_class[name][label]) for name in models)) for label in classes
        ]
        means = (_number(mean_precision(matches[name], classes)) for name in models)
        rows.append((group, "**mean**", sum(objects.values()), *(f"**{value}**" for value in means)))
    return table(("scenes", "class", "objects in frames", *models), rows)


def part_table(groups: Groups, model: str, classes: Sequence[str] = CLASSES) -> str:
    """A row a group: mean average precision of every template of one model, each on its own half."""
    rows = [
        (group, *(_number(mean_precision(all_matches(by_model[model], part), classes)) for part in Part))
        for group, by_model in groups.items()
    ]
    return table(("scenes", *(part.name.lower() for part in Part)), rows)


def threshold_at(claims: Scored, false_per_image: float) -> float:
    """The least score that lets no more false claims through than so many an image."""
    passed = counts(claims)
    within = passed.threshold[passed.wrong <= false_per_image * claims.images]
    return float(within.min()) if len(within) else np.inf


def occlusion_table(judged: Sequence[JudgedScene]) -> str:
    """A row a bin of occlusion of the whole object: recall and mean score of every template."""
    sights = _sights(judged)
    least = [threshold_at(scored(all_matches(judged, part)), FALSE_PER_IMAGE) for part in Part]
    rows = []
    for label, inside in _bins(sights.occlusion[:, Part.WHOLE]):
        recall = [float(np.mean(sights.found[inside, part] >= least[part])) for part in Part] if inside.any() else []
        score = [float(np.mean(sights.score[inside, part])) for part in Part] if inside.any() else []
        rows.append((label, int(inside.sum()), *_shown(inside, recall), *_shown(inside, score)))
    names = [part.name.lower() for part in Part]
    return table(("hidden", "objects", *(f"recall {n}" for n in names), *(f"score {n}" for n in names)), rows)


def halves_table(judged: Sequence[JudgedScene]) -> str:
    """Objects of which one half is seen: what happens as the other one disappears.

    An object may count for several of its halves. The mean score of the template that looks at the half that
    disappears, of the one that looks at the half that is seen, and of the whole one.
    """
    occlusion, score = _halves(_sights(judged))
    rows = []
    for label, inside in _bins(occlusion):
        means = score[inside].mean(axis=0).tolist() if inside.any() else []
        rows.append((label, int(inside.sum()), *_shown(inside, means, 3)))
    return table(("one half hidden", "halves", "its template", "the other half's", "the whole's"), rows)


def trend_lines(judged: Sequence[JudgedScene]) -> str:
    """Whether figure 4 of the paper is there: the whole best where all is seen, a half where the other one is gone."""
    sights = _sights(judged)
    open_ = (sights.occlusion < SEEN).all(axis=1)
    occlusion, score = _halves(sights)
    gone = occlusion >= GONE
    if min(open_.sum(), gone.sum()) < FEWEST:
        return f"- Fewer than {FEWEST} objects seen whole, or with one half gone: no verdict."
    whole, *halves = (float(value) for value in sights.score[open_].mean(axis=0))
    best = "best" if whole > max(halves) else "NOT best"
    kept, lost = (float(score[gone, column].mean() / score[~gone, column].mean()) for column in (1, 2))
    less = "less" if kept > lost else "NOT less"
    return (
        f"- Nothing hidden: the whole template scores {whole:.2f} and is {best}; the halves {min(halves):.2f} to "
        f"{max(halves):.2f}.\n"
        f"- One half hidden by {100 * GONE:.0f} % and more, the other one seen: the template of the half that is seen "
        f"keeps {100 * kept:.0f} % of its score, {less} affected than the whole one, which keeps {100 * lost:.0f} %."
    )


def _halves(sights: Sights) -> tuple[np.ndarray, np.ndarray]:
    """Of halves whose opposite is seen: hidden share (N,); scores (N, 3) of its template, the other's, the whole."""
    hidden, columns = [], []
    for half, other in OPPOSITE.items():
        rows = sights.occlusion[:, other] < SEEN
        hidden.append(sights.occlusion[rows, half])
        columns.append(np.stack([sights.score[rows, part] for part in (half, other, Part.WHOLE)], axis=1))
    return np.concatenate(hidden), np.concatenate(columns)


def speed_line(groups: Groups) -> str:
    """Median milliseconds a frame of every model, scenes alike."""
    models = list(next(iter(groups.values())))
    times = {name: [scene.milliseconds for by_model in groups.values() for scene in by_model[name]] for name in models}
    return ", ".join(f"{name} {np.median(values):.0f} ms" for name, values in times.items())


def _sights(judged: Sequence[JudgedScene]) -> Sights:
    return Sights.joined([scene.sights for scene in judged if scene.sights is not None])


def _bins(values: np.ndarray) -> Iterable[tuple[str, np.ndarray]]:
    for low, high in pairwise(BINS):
        inside = (values >= low) & ((values < high) | (high == BINS[-1]))
        yield f"{100 * low:.0f} to {100 * high:.0f} %", inside


def _shown(inside: np.ndarray, values: Sequence[float], count: int = len(Part)) -> list[str]:
    show: Callable[[float], str] = "{:.2f}".format
    return [show(value) for value in values] if inside.sum() >= FEWEST else ["-"] * count


def _fair(matches: Iterable[Matches], class_id: int) -> int:
    return sum(int((match.true.fair & (match.true.class_id == class_id)).sum()) for match in matches)


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"
