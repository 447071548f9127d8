"""Which class a track is of, if any, learned from tracks whose truth is known: ours, beyond the paper.

Bayes' rule (equation 2) takes the views of a track as independent, which they are not, and asks nothing else. Here the
distribution over classes and background is a multinomial logistic regression on the features of `track_evidence`,

    log p(c) = weights_c . (features - centre) / scale + offset_c - log of the sum over all classes,

the share of views in which a track was seen among them, so that no rule of 60 % is needed.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import minimize
from scipy.special import log_softmax, softmax

from ...datasets.errors import InputError, UserError
from ...datasets.json_record import JsonRecord
from .track_evidence import feature_count

SCHEMA = "thingmap-track-judge/1"
DIGITS = 6  # significant ones, in the file
RIDGE = 7.0  # weight of squared weights beside the log likelihood; tried on rendered tables of seeds 4 to 6
LIMIT = 6.0  # scales from the centre beyond which a feature says no more
MOST_STEPS = 1000
_REMEDY = "make it with benchmarks/shape_context_judge.py"


@dataclass(frozen=True, slots=True, eq=False)
class TrackJudge:
    """The parameters for K classes and F features.

    Attributes:
        classes: K names, of the detector that the tracks were of.
        centre, scale: (F,) of the features.
        weights: (K + 1, F), the background last.
        offset: (K + 1,).
        learned_from: for people.

    Raises:
        ValueError: they are not finite numbers of these shapes, or a scale is not positive.
    """

    classes: tuple[str, ...]
    centre: np.ndarray
    scale: np.ndarray
    weights: np.ndarray
    offset: np.ndarray
    learned_from: str

    def __post_init__(self) -> None:
        rows, wide = len(self.classes) + 1, feature_count(len(self.classes))
        for name, shape in (("centre", (wide,)), ("scale", (wide,)), ("weights", (rows, wide)), ("offset", (rows,))):
            array = np.asarray(getattr(self, name), dtype=np.float64)
            if array.shape != shape or not np.isfinite(array).all():
                raise ValueError(f"{name} must be {shape} finite numbers, but got shape {array.shape}")
            object.__setattr__(self, name, array)
        if not np.all(self.scale > 0.0):
            raise ValueError("scale must be positive")

    def distribution(self, features: np.ndarray) -> np.ndarray:
        """(T, K + 1) probabilities that add up to 1, the background's last, from (T, F) features."""
        return softmax(_standard(features, self.centre, self.scale) @ self.weights.T + self.offset, axis=1)

    def check(self, classes: Sequence[str]) -> None:
        """Raises UserError unless a detector's classes are those that were learned, in their order."""
        if tuple(classes) != self.classes:
            raise UserError(
                f"the judge of tracks was learned for the classes {', '.join(self.classes)}, but the detector has "
                f"{', '.join(classes)}; {_REMEDY}, or leave it out"
            )

    def save(self, path: Path) -> None:
        """A JSON file.

        Raises:
            UserError: it cannot be written.
        """
        numbers = {name: getattr(self, name) for name in ("centre", "scale", "weights", "offset")}
        content = {
            "schema": SCHEMA,
            "learned_from": self.learned_from,
            "classes": list(self.classes),
            **{name: _rounded(array) for name, array in numbers.items()},
        }
        try:
            path.write_text(json.dumps(content) + "\n", "utf-8")
        except OSError as error:
            raise UserError(f"{path} cannot be written: {error.strerror}") from error


def shipped_judge() -> Path:
    """Of tracks of the shape-context detector that ships, by benchmarks/shape_context_judge.py."""
    return Path(__file__).with_name("judge.json")


def load_judge(path: Path) -> TrackJudge:
    """Raises InputError for a file that is not what `TrackJudge.save` writes."""
    try:
        record = JsonRecord(json.loads(path.read_text("utf-8")), path, _REMEDY)
        if record.text("schema") != SCHEMA:
            raise InputError(path, f"schema {SCHEMA}", record.text("schema"), _REMEDY)
        arrays = {name: np.array(record.anything(name), float) for name in ("centre", "scale", "weights", "offset")}
        names = tuple(str(name) for name in record.anything("classes"))
        return TrackJudge(names, learned_from=record.text("learned_from"), **arrays)
    except (OSError, UnicodeDecodeError, ValueError, TypeError) as error:
        raise InputError(path, "a judge of tracks", " ".join(str(error).split()), _REMEDY) from error


def fit_judge(
    features: np.ndarray, label: np.ndarray, weight: np.ndarray, classes: Sequence[str], learned_from: str
) -> TrackJudge:
    """Most likely parameters under a Gaussian prior on the weights.

    Args:
        features: (N, F) of tracks, N > 0.
        label: (N,) int, the true class of each, K for background.
        weight: (N,) how much each counts.
        classes: K names.
        learned_from: for people.

    Raises:
        ValueError: shapes that differ, or a label out of range.
    """
    if not len(features) == len(label) == len(weight) > 0:
        sizes = f"{len(features)}, {len(label)}, {len(weight)}"
        raise ValueError(f"need as many labels and weights as tracks, at least one, but got {sizes}")
    rows, wide = len(classes) + 1, features.shape[1]
    if label.min() < 0 or label.max() >= rows:
        raise ValueError(f"labels must be in 0..{rows - 1}, but range from {label.min()} to {label.max()}")
    centre, scale = features.mean(axis=0), features.std(axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    x, true = _standard(features, centre, scale), np.eye(rows)[label]

    def loss(parameters: np.ndarray) -> tuple[float, np.ndarray]:
        table = parameters.reshape(rows, wide + 1)
        log_p = log_softmax(x @ table[:, :wide].T + table[:, wide], axis=1)
        off = weight[:, None] * (np.exp(log_p) - true)
        pull = np.column_stack([RIDGE * table[:, :wide], np.zeros(rows)])
        value = -float(weight @ (log_p * true).sum(axis=1)) + 0.5 * float((pull * table).sum())
        return value, (np.column_stack([off.T @ x, off.sum(axis=0)]) + pull).ravel()

    start = np.zeros(rows * (wide + 1))
    found = minimize(loss, start, jac=True, method="L-BFGS-B", options={"maxiter": MOST_STEPS})
    table = found.x.reshape(rows, wide + 1)
    offset = table[:, wide] - table[:, wide].mean()  # the same to all, which says nothing, would be wherever it started
    return TrackJudge(tuple(classes), centre, scale, table[:, :wide], offset, learned_from)


def _standard(features: np.ndarray, centre: np.ndarray, scale: np.ndarray) -> np.ndarray:
    return np.clip((features - centre) / scale, -LIMIT, LIMIT)


def _rounded(array: np.ndarray) -> list[float]:
    return json.loads(json.dumps(array.tolist()), parse_float=lambda text: float(f"{float(text):.{DIGITS}g}"))
