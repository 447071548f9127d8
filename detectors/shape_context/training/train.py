"""The algorithm: codebooks of shape contexts from views of objects (Georgakis et al., III-A).

1. Views of every class are divided: most are learned from, some are held out.
2. Edges of the learned views; a codebook for each candidate radius, and how well held-out views of the class, and
   proposals of background frames that show it, score above all else by it.
3. The radius is the one that does best on average over the classes. (The paper chooses one for each class; but classes
   hardly differ in it, so that chance decides, and of one radius points are described once.)
4. Descriptors of what is none of the classes, from proposals of background frames.
5. Scores become probabilities: on held-out views of all classes, and on proposals of other background frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from ....datasets.errors import UserError
from ....datasets.object_views.backgrounds import Backgrounds
from ....datasets.object_views.object_view import ObjectViews
from ...training.digest import names_digest
from ..codebook import Codebook
from ..model import ShapeContextModel
from .calibrating import fit, gather_samples
from .checkpoint import JudgedClass, load_checkpoint, save_checkpoint
from .codebooks import build_codebook
from .config import TrainConfig
from .material import Material, OnProgress, gather, read_outlines
from .outlines import Outline
from .radius import best_radius, separations
from .rivals import learn_rivals
from .scenes import NEITHER, Scene, scenes_of


def train(
    views: ObjectViews,
    backgrounds: Backgrounds,
    config: TrainConfig | None = None,
    on_progress: OnProgress = lambda stage, done, total: None,
    checkpoint: Path | None = None,
    sources: Sequence[str] = (),
) -> ShapeContextModel:
    """A model of all classes of the views; the same views, frames and settings give the same one.

    Args:
        views: of the objects, with depth and masks; others are skipped.
        backgrounds: frames in which the objects are absent, or known; may be none at all.
        config: the numbers.
        on_progress: hears the stage, and how much of it is done of how much.
        checkpoint: file to go on from and to keep the state in after every class; None for none. It is not removed.
        sources: names of where everything came from, for the model's `about`.

    Raises:
        UserError: the sources lack something (see `gather`), or nothing to tell a single class from is in the
            backgrounds.
        InputError: the checkpoint is not of this training.
    """
    config = config or TrainConfig()
    settings = _settings(views, backgrounds, config, sources)
    judged = {} if checkpoint is None else load_checkpoint(checkpoint, settings)
    material = gather(views, backgrounds, config, on_progress)
    number = len(material.rival_frames)
    looking = scenes_of(
        material.rival_frames, material.classes, config, lambda done: on_progress("looking at frames", done, number)
    )
    scenes = list(looking)
    for label in material.classes:
        if label not in judged:
            judged[label] = judge_radii(label, material, scenes, config, on_progress)
            if checkpoint is not None:
                save_checkpoint(checkpoint, settings, judged)
        views.skipped.update(judged[label].skipped)
    radii = sorted(config.radii)
    areas = np.mean([judged[label].areas for label in material.classes], axis=0)
    radius = best_radius(radii, areas)
    codebooks = tuple(_codebook(label, radius, material, config, on_progress) for label in material.classes)
    rivals = learn_rivals(scenes, len(material.classes), codebooks, config)
    total = sum(map(len, material.held_out.values())) + len(material.frames)
    samples = gather_samples(codebooks, rivals, material, config, lambda done: on_progress("calibrating", done, total))
    counts = samples.counts().tolist()
    about = {
        "settings": settings,
        "radius": radius,
        "separation": {f"{r:g}": round(float(area), 4) for r, area in zip(radii, areas, strict=True)},
        "classes": {
            label: {**judged[label].about, "entries": len(book)}
            for label, book in zip(material.classes, codebooks, strict=True)
        },
        "rivals": {f"{radius:g}": len(array) for radius, array in rivals.items()},
        "calibration": {
            "objects": dict(zip(material.classes, counts[:-1], strict=True)),
            "background": counts[-1],
            "background_is": "proposals of frames" if samples.from_frames else "objects of other classes",
        },
    }
    return ShapeContextModel(material.classes, codebooks, rivals, fit(samples), config.voting, about)


def judge_radii(
    label: str, material: Material, scenes: Sequence[Scene], config: TrainConfig, on_progress: OnProgress
) -> JudgedClass:
    """Step 2 for one class.

    Raises:
        UserError: see `train`.
    """
    views, indices = material.views, material.learned[label]
    outlines = _outlines(label, material, config, on_progress)
    names = (views.entries[index].name for index in indices)
    skipped = {name: views.skipped[name] for name in names if name in views.skipped}
    books = [build_codebook(outlines, radius, config) for radius in sorted(config.radii)]
    tried = [book for book in books if book is not None]
    if not tried:
        raise UserError(f"{label!r}: its edges are too sparse for a descriptor of {max(config.radii)} m")
    own, others = _validation_scores(label, tried, material, scenes, config, on_progress)
    by_radius = {book.radius: area for book, area in zip(tried, separations(own, others), strict=True)}
    areas = np.array([by_radius.get(radius, 0.0) for radius in sorted(config.radii)])
    about = {
        "views": len(outlines),
        "held_out_views": len(material.held_out[label]),
        "in_frames": len(own) - len(material.held_out[label]),
        "instances_held_out": material.instances[label],
        "separation": {f"{radius:g}": round(float(area), 4) for radius, area in by_radius.items()},
    }
    return JudgedClass(areas, about, skipped)


def _codebook(label: str, radius: float, material: Material, config: TrainConfig, on_progress: OnProgress) -> Codebook:
    book = build_codebook(_outlines(label, material, config, on_progress), radius, config)
    if book is None:
        raise UserError(f"{label!r}: its edges are too sparse for a descriptor of {radius} m, which suits the others")
    return book


def _outlines(label: str, material: Material, config: TrainConfig, on_progress: OnProgress) -> list[Outline]:
    indices = material.learned[label]
    told = read_outlines(
        material.views, indices, config, lambda done: on_progress(f"{label}: edges", done, len(indices))
    )
    return list(told)


def _validation_scores(
    label: str,
    codebooks: Sequence[Codebook],
    material: Material,
    scenes: Sequence[Scene],
    config: TrainConfig,
    on_progress: OnProgress,
) -> tuple[np.ndarray, np.ndarray]:
    """(N, R) scores of what shows a class and (M, R) of what does not, by R codebooks of the class.

    They are of held-out views and of the frames' proposals: views of single objects are too easy to tell radii apart.

    Raises:
        UserError: nothing shows anything else.
    """
    rest = [one for other, outlines in material.held_out.items() if other != label for one in outlines]
    some = np.linspace(0, len(rest) - 1, min(len(rest), config.other_views)).round().astype(int) if rest else []
    views = [*((one, True) for one in material.held_out[label]), *((rest[k], False) for k in some)]
    total, wanted = len(views) + len(scenes), material.classes.index(label)
    scores, is_own = [], []
    for number, (one, own) in enumerate(views):
        scores.append(one.scores(codebooks, config).normalised)
        is_own.append(np.array([own]))
        on_progress(f"{label}: radius", number + 1, total)
    for number, scene in enumerate(scenes):
        clear = scene.shows != NEITHER
        scores.append(scene.scores(codebooks, config).normalised[clear])
        is_own.append(scene.shows[clear] == wanted)
        on_progress(f"{label}: radius", len(views) + number + 1, total)
    every, own = np.concatenate(scores), np.concatenate(is_own)
    if own.all():
        raise UserError(
            f"{label!r} alone: nothing in the backgrounds stands out as a thing that it could be told from; "
            "give --background frames with other things, or another class"
        )
    return every[own], every[~own]


def _settings(
    views: ObjectViews, backgrounds: Backgrounds, config: TrainConfig, sources: Sequence[str]
) -> dict[str, Any]:
    """All that the model depends on, as JSON; views and frames by a digest of their names."""
    numbers = {name: value for name, value in asdict(config).items() if name != "memory"}
    return {
        **numbers,
        "radii": list(config.radii),
        "sources": list(sources),
        "names": names_digest(views, backgrounds),
        "thingmap": version("thingmap"),
    }
