"""Everything that learning starts from: views and frames divided up, windows chosen, a learner for each template."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ....datasets.errors import UserError
from ....datasets.object_views.backgrounds import Background, Backgrounds
from ....datasets.object_views.object_view import ObjectView, ObjectViews
from ...detections import Part
from ...training.images import kept_frames, kept_views
from ...training.keeping import Kept
from ...training.selection import select_views, split_frames
from .config import TrainConfig
from .frames import mined_frames
from .learner import Learner, new_learner
from .positives import collect_examples
from .windows import class_windows

OnProgress = Callable[[str, int, int], None]  # stage, done, of how many


@dataclass(frozen=True, slots=True, eq=False)
class Material:
    """What the sources gave.

    Attributes:
        classes: labels, sorted.
        learners: five for each window of a class, in the order of `classes` and `Part`.
        mined: frames to find negatives in.
        held_out_views, held_out_frames: for calibration alone.
        counts: about the sources, for the model's `about`: JSON.
    """

    classes: tuple[str, ...]
    learners: tuple[Learner, ...]
    mined: Kept[Background | None]
    held_out_views: Kept[ObjectView | None]
    held_out_frames: Kept[Background | None]
    counts: dict


def gather(views: ObjectViews, backgrounds: Backgrounds, config: TrainConfig, on_progress: OnProgress) -> Material:
    """Reads the views and makes the learners.

    Raises:
        UserError: there are no views or no frames, views or frames lack depth that the channels need, or all views of a
            class are unusable.
    """
    selection = select_views(views, config.held_out, config.views, config.held_out_views, config.seed)
    learned, held_out = split_frames(len(backgrounds), config.held_out)
    frames = kept_frames(backgrounds, learned, config.memory // 4)
    pictures = kept_views(views, selection.learned, config.memory // 2)
    boxes, labels = _read_boxes(views.labels, pictures, config, on_progress)
    _check_frames(frames, config)
    windows = {label: class_windows(box, config) for label, box in boxes.items()}
    own, others = collect_examples(
        pictures, labels, windows, frames, config, lambda done: on_progress("features of objects", done, len(pictures))
    )
    positives = {label: sum(len(one) for (its, _), one in own.items() if its == label) for label in windows}
    for label, count in positives.items():
        if count == 0:
            raise UserError(
                f"no view of {label!r} has a size at which it could be found ({_sizes(boxes[label])}); "
                "take pictures from nearer or farther, or leave the class out"
            )
    learners = [
        new_learner(number, part, shape, own[label, k], others[label, k])
        for number, (label, its) in enumerate(windows.items())
        for k, shape in enumerate(its.shapes)
        for part in Part
        if len(own[label, k])
    ]
    counts = {
        "frames": len(frames),
        "frames_held_out": len(held_out),
        "classes": {
            label: {
                "views": len(boxes[label]),
                "positives": positives[label],
                "objects_of_other_classes": len(others[label, 0]),
                "instances_held_out": selection.instances[label],
                "windows": [[shape.rows, shape.columns] for shape in windows[label].shapes],
            }
            for label in windows
        },
    }
    mined = mined_frames(frames, pictures, config)
    aside = kept_views(views, selection.held_out, config.memory // 4)
    return Material(
        tuple(windows), tuple(learners), mined, aside, kept_frames(backgrounds, held_out, config.memory // 4), counts
    )


def _read_boxes(
    labels: tuple[str, ...], pictures: Kept[ObjectView | None], config: TrainConfig, on_progress: OnProgress
) -> tuple[dict[str, np.ndarray], list[str | None]]:
    """(N, 4) boxes of the views of every class, and the class of each view, None for one that cannot be used."""
    of_views: list[str | None] = []
    boxes: dict[str, list[np.ndarray]] = {label: [] for label in labels}
    for number, view in enumerate(pictures):
        if view is not None:
            if config.channels.use_depth and view.depth is None:
                raise UserError(
                    f"{view.name}: this view has no depth; train with --channels rgb, or give views with depth"
                )
            boxes[view.label].append(view.xyxy)
        of_views.append(None if view is None else view.label)
        on_progress("reading objects", number + 1, len(pictures))
    for label, found in boxes.items():
        if not found:
            raise UserError(f"no view of {label!r} can be used; leave the class out, or give other views of it")
    return {label: np.stack(found) for label, found in boxes.items()}, of_views


def _check_frames(frames: Kept[Background | None], config: TrainConfig) -> None:
    first = next((frame for frame in frames if frame is not None), None)
    if first is None:
        raise UserError("no frame of the backgrounds can be used; give --background a sequence without the objects")
    if config.channels.use_depth and first.depth is None:
        raise UserError(f"{first.name}: the background has no depth; train with --channels rgb, or give one with depth")


def _sizes(boxes: np.ndarray) -> str:
    side = np.sqrt((boxes[:, 2:] - boxes[:, :2]).prod(axis=1))
    return f"{side.min():.0f} to {side.max():.0f} px"
