"""The algorithm: templates learned from views of objects and from what they mistake for them (Lai et al., III-C).

1. Positives: every view through its class's window, as it is and mirrored; its halves are the parts' positives.
2. First negatives: random windows of the background, and objects of the other classes.
3. A linear SVM for every class and part, each by itself.
4. Hard negatives: the highest false positives on all background frames join the negatives; the easiest leave.
5. 3 and 4 again, up to ten rounds; a template for which nothing new is found is done.
6. Platt's sigmoid from held-out objects and frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

from ....datasets.object_views.backgrounds import Backgrounds
from ....datasets.object_views.object_view import ObjectViews
from ...training.digest import names_digest
from ..model import HogModel
from .calibration import calibrated
from .checkpoint import load_checkpoint, save_checkpoint
from .config import TrainConfig
from .learner import Learner
from .material import Material, OnProgress, gather
from .rounds import first_negatives, hard_negatives, restore_negatives
from .svm import check_installed


def train(
    views: ObjectViews,
    backgrounds: Backgrounds,
    config: TrainConfig | None = None,
    on_progress: OnProgress = lambda stage, done, total: None,
    checkpoint: Path | None = None,
    sources: Sequence[str] = (),
) -> HogModel:
    """A model of all classes of the views.

    The same views, frames and settings give the same model, however many workers there are.

    Args:
        views: of the objects.
        backgrounds: frames in which they are absent, or known.
        config: the numbers.
        on_progress: hears the stage, and how much of it is done of how much.
        checkpoint: file to go on from and to keep the state in after every round; None for none. It is not removed.
        sources: names of where everything came from, for the model's `about`.

    Raises:
        UserError: scikit-learn is absent, or the sources lack something (see `gather`).
        InputError: the checkpoint is not of this training.
    """
    check_installed()
    config = config or TrainConfig()
    material = gather(views, backgrounds, config, on_progress)
    settings = _settings(material, config, sources) | {"names": names_digest(views, backgrounds)}
    rounds = _resume_or_start(material, config, checkpoint, settings, on_progress)
    for number in range(rounds, config.rounds):
        active = [learner for learner in material.learners if not learner.done]
        if not active:
            break
        rounds = number + 1
        _fit(active, config, f"round {rounds}: learning", on_progress)
        _mine(active, material, config, f"round {rounds}: mining", on_progress)
        if checkpoint is not None:
            save_checkpoint(checkpoint, settings, rounds, material.learners)
    _fit([learner for learner in material.learners if not learner.done], config, "learning", on_progress)
    total = len(material.held_out_views) + len(material.held_out_frames)
    templates = calibrated(
        [learner.template for learner in material.learners],
        material.classes,
        material.held_out_views,
        material.held_out_frames,
        config,
        lambda done: on_progress("calibrating", done, total),
    )
    about = _about(material, settings, rounds)
    return HogModel(material.classes, config.channels, tuple(templates), config.pyramid, about)


def _resume_or_start(
    material: Material, config: TrainConfig, checkpoint: Path | None, settings: dict, on_progress: OnProgress
) -> int:
    """Gives the learners their negatives; returns how many rounds are done."""
    total = len(material.mined)
    saved = None if checkpoint is None else load_checkpoint(checkpoint, settings, material.learners)
    if saved is None:
        first_negatives(
            material.learners,
            material.mined,
            material.classes,
            config,
            lambda done: on_progress("first negatives", done, total),
        )
        return 0
    restore_negatives(
        material.learners,
        saved.places,
        material.mined,
        config,
        lambda done: on_progress(f"going on after round {saved.rounds}", done, total),
    )
    return saved.rounds


def _fit(learners: Sequence[Learner], config: TrainConfig, stage: str, on_progress: OnProgress) -> None:
    """Step 3; a thread for each SVM, since liblinear works without the interpreter."""
    pool = ThreadPoolExecutor(config.workers)
    try:
        for number, _ in enumerate(pool.map(lambda learner: learner.fit(config.cost), learners)):
            on_progress(stage, number + 1, len(learners))
    finally:
        pool.shutdown(cancel_futures=True)  # after Ctrl-C only those that have begun are waited for


def _mine(
    learners: Sequence[Learner], material: Material, config: TrainConfig, stage: str, on_progress: OnProgress
) -> None:
    """Step 4."""
    total = len(material.mined)
    found = hard_negatives(
        learners, material.mined, material.classes, config, lambda done: on_progress(stage, done, total)
    )
    for learner, negatives in zip(learners, found, strict=True):
        learner.take(negatives, config.cache)


def _settings(material: Material, config: TrainConfig, sources: Sequence[str]) -> dict[str, Any]:
    """All that the model depends on, as JSON."""
    numbers = {name: value for name, value in asdict(config).items() if name not in {"workers", "memory"}}
    return {
        **numbers,
        "channels": config.channels.value,
        "sources": list(sources),
        "counts": material.counts,
        "thingmap": version("thingmap"),
    }


def _about(material: Material, settings: dict[str, Any], rounds: int) -> dict[str, Any]:
    """For people: where the model comes from."""
    by_part: dict[str, dict[str, int]] = {label: {} for label in material.classes}
    for learner in material.learners:
        row, part = by_part[material.classes[learner.template.class_id]], learner.template.part.name.lower()
        row[part] = row.get(part, 0) + len(learner.negatives)
    return {"settings": settings, "rounds_done": rounds, "negatives": by_part}
