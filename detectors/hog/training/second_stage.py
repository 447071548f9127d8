"""The second stage learned: the windows that templates propose in frames whose objects are known, and the network.

Frames must be others than those that the templates were learned from: there, templates are surer than they should be.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace

import numpy as np

from ....datasets.errors import UserError
from ....datasets.object_views.backgrounds import Background, Backgrounds
from ...boxes import box_ious
from ...detections import Part
from ...training.images import kept_frames
from ..candidates import corner_boxes, scored_levels
from ..model import HogModel
from ..pyramid import build_pyramid
from ..scoring import Scorer
from ..second_stage.judged import proposed_windows
from ..second_stage.network import box_offsets
from ..second_stage.window_views import view_size, window_views
from .network_fit import UNKNOWN, FitConfig, WindowSamples, fit_network

OnProgress = Callable[[str, int, int], None]


@dataclass(frozen=True, slots=True)
class SecondStageConfig:
    """What windows count as, and how the network is learned.

    Attributes:
        shows: intersection over union with the box of an object, or of what is seen of it, from which a window shows
            it. Less than what a right box must have: the box is corrected.
        apart: below which a window shows no object; what lies between counts as neither.
        least_visible: share of an object that must be seen; windows on one of which less is seen count as neither.
        fit: of the network.
    """

    shows: float = 0.4
    apart: float = 0.3
    least_visible: float = 0.25
    fit: FitConfig = field(default_factory=FitConfig)


def train_second_stage(
    model: HogModel,
    frames: Backgrounds,
    config: SecondStageConfig | None = None,
    on_progress: OnProgress = lambda stage, done, total: None,
    sources: Sequence[str] = (),
) -> HogModel:
    """The model with a second stage for its templates of whole objects; one that it had is replaced.

    Args:
        model: whose channels include depth.
        frames: in which all objects of its classes are known.
        config: the numbers.
        on_progress: hears the stage, and how much of it is done of how much.
        sources: names of where the frames come from, for the model's `about`.

    Raises:
        UserError: the model does not look at depth, or the frames show too little.
    """
    config = config or SecondStageConfig()
    if not model.channels.use_depth:
        raise UserError(f"a second stage needs a model that looks at depth, and this one looks at {model.channels}")
    parts = []
    for number, frame in enumerate(kept_frames(frames, range(len(frames)), 0)):
        if frame is not None:
            parts.append(window_samples(model, frame, config))
        on_progress("looking at windows", number + 1, len(frames))
    samples = _joined(parts, view_size(model.channels.count, len(model.classes)))
    counts = np.bincount(samples.label[samples.label != UNKNOWN], minlength=len(model.classes) + 1)
    if (counts == 0).any():
        names = [*model.classes, "nothing"]
        lacking = ", ".join(names[k] for k in np.flatnonzero(counts == 0))
        raise UserError(f"no window of {len(parts)} frames shows {lacking}; add frames that do")
    epochs = config.fit.epochs
    network = fit_network(
        samples, len(model.classes), config.fit, lambda done, loss: on_progress("learning", done, epochs)
    )
    about = {
        "settings": {**asdict(config), "sources": list(sources)},
        "frames": len(parts),
        "windows": dict(zip([*model.classes, "background"], counts.tolist(), strict=True)),
    }
    return replace(model, second_stage=network, about={**model.about, "second_stage": about})


def window_samples(model: HogModel, frame: Background, config: SecondStageConfig) -> WindowSamples:
    """The windows that the model's templates propose in a frame, and what they show."""
    if frame.depth is None:
        raise UserError(f"{frame.name} has no depth, which a second stage needs; leave it out")
    templates = tuple(template for template in model.templates if template.part == Part.WHOLE)
    pyramid = build_pyramid(frame.color, frame.depth, frame.focal, model.channels, model.pyramid)
    levels = scored_levels(pyramid, Scorer(templates), corner_boxes(templates))
    proposed = proposed_windows(levels, templates, pyramid.width, pyramid.height)
    views = window_views(pyramid, frame.depth, frame.focal, proposed, len(model.classes))
    label, offsets = what_they_show(proposed.xyxy, frame, model.classes, config)
    return WindowSamples(views.astype(np.float16), label, offsets)


def what_they_show(
    xyxy: np.ndarray, frame: Background, classes: Sequence[str], config: SecondStageConfig
) -> tuple[np.ndarray, np.ndarray]:
    """Labels (N,) of windows with boxes (N, 4), and offsets (N, 4) to the box of the object: of all of it or of what is
    seen, whichever the window has more in common with."""
    label, offsets = np.full(len(xyxy), len(classes), dtype=np.int64), np.zeros((len(xyxy), 4), np.float32)
    known = np.array([label in classes for label in frame.labels], dtype=bool)
    if not known.any() or not len(xyxy):
        return label, offsets
    whole, visibility = frame.xyxy[known], frame.visibility[known]
    visible = whole if frame.visible is None else frame.visible[known]
    class_id = np.array([classes.index(name) for name in frame.labels if name in classes])
    both = np.stack([box_ious(xyxy, whole), box_ious(xyxy, visible)])
    overlap, rows = both.max(axis=0), np.arange(len(xyxy))
    nearest = overlap.argmax(axis=1)
    closest = overlap[rows, nearest]
    shows = closest >= config.shows
    label[shows] = class_id[nearest[shows]]
    label[(closest >= config.apart) & (~shows | (visibility[nearest] < config.least_visible))] = UNKNOWN
    is_part = both[1, rows, nearest] > both[0, rows, nearest]
    true = np.where(is_part[:, None], visible[nearest], whole[nearest])
    offsets[shows] = box_offsets(xyxy[shows], true[shows])
    return label, offsets


def _joined(parts: Sequence[WindowSamples], size: int) -> WindowSamples:
    return WindowSamples(
        np.concatenate([np.zeros((0, size), np.float16), *(one.views for one in parts)]),
        np.concatenate([np.zeros(0, np.int64), *(one.label for one in parts)]),
        np.concatenate([np.zeros((0, 4), np.float32), *(one.offsets for one in parts)]),
    )
