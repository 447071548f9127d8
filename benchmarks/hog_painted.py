"""What a template makes of an object of which one half is painted over, and nothing else is changed.

Figure 4 of the Explicit Occlusion paper, controlled: "the performance of a partial detector does not change at all if
an instance is occluded in regions ignored by the template" (section 4.1). In scenes, what hides a half comes with
another place, distance and neighbours, and may reach over the middle; here the same object in the same frame is scored
again and again. What reaches a half's template across the middle of the object is then its own: its window lies on the
grid of cells, not on the middle, and the features of a cell look one cell further (votes) and another one (blocks).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from hog_job import scores_at
from hog_report import OPPOSITE
from results import table
from suite import Scene
from suite_job import scene_folder

from thingmap.datasets.frame import Frame
from thingmap.datasets.ground_truth import GroundTruth
from thingmap.datasets.open_truth import open_truth
from thingmap.detectors.detections import Part
from thingmap.detectors.hog.model import HogModel, load_model
from thingmap.detectors.parts import part_box
from thingmap.mapper.evaluation.boxes.image_boxes import EDGE

SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)  # of a half that are painted over
SEEN_WELL = 0.9  # least visible share of an object
AHEAD = 0.05  # m that what is painted is before the object
NEAREST = 0.1  # m, least depth painted
TRIES = 50  # places looked at for a piece of background
AROUND = 1.5  # of the object's longer side, kept of the image on each side of it: no window on it reaches further


@dataclass(frozen=True, slots=True)
class PaintJob:
    """A scene in a folder, every how many frames it is looked at, by which model, and how many objects at most."""

    scene: Scene
    step: int
    model: Path
    folder: Path
    most: int


@dataclass(frozen=True, slots=True, eq=False)
class Sitter:
    """An object in a frame: its label, its box, and (M, 4) all boxes there; pixels from the image's outer edges."""

    frame: int
    label: str
    box: np.ndarray
    boxes: np.ndarray


def paint_scene(job: PaintJob) -> np.ndarray:
    """Probabilities of N objects' own class at their true place, (N, 4, 5, 5): by half, share painted of it, `Part`.

    The same objects are drawn each time. Of each template the best window counts whose box overlaps the true box, or
    its own half of that, by half, as in `scores_at`: as shares grow, it may be another window.
    """
    truth, model = open_truth(scene_folder(job.scene, job.folder)), load_model(job.model)
    assert truth.sequence is not None
    there = seen_well(truth, job.step)
    rng = np.random.default_rng(job.scene.seed)
    drawn = [there[k] for k in np.sort(rng.permutation(len(there))[: job.most])]
    scores = [painted_scores(truth.sequence[sitter.frame], sitter, model, rng) for sitter in drawn]
    return np.array(scores).reshape(-1, len(OPPOSITE), len(SHARES), len(Part))


def seen_well(truth: GroundTruth, step: int) -> list[Sitter]:
    """Of every `step`-th frame, the objects of known classes that are whole in the image and hardly hidden."""
    assert truth.sequence is not None and truth.frame_truth is not None and truth.intrinsics is not None
    labels = {thing.id: thing.label for thing in truth.objects}
    size = np.array([truth.intrinsics.width, truth.intrinsics.height])
    found = []
    for number in range(0, len(truth.sequence), step):
        seen = truth.frame_truth(number)
        boxes = np.zeros((0, 4)) if seen is None else seen.xyxy + EDGE
        for row, box in enumerate(boxes):
            assert seen is not None
            whole = (box[:2] >= 0.0).all() and (box[2:] <= size).all()
            if whole and seen.visibility[row] >= SEEN_WELL and int(seen.object_id[row]) in labels:
                found.append(Sitter(number, labels[int(seen.object_id[row])], box, boxes))
    return found


def painted_scores(frame: Frame, sitter: Sitter, model: HogModel, rng: np.random.Generator) -> np.ndarray:
    """(4, 5, 5) of one object: by half, share painted of it, and `Part`; see `paint_scene`."""
    number = model.classes.index(sitter.label)
    scales = model.pyramid.scales(frame.intrinsics.width, frame.intrinsics.height)
    pyramid = replace(model.pyramid, min_scale=scales[-1], min_cells=1)  # those of the whole image
    own = replace(model, templates=tuple(t for t in model.templates if t.class_id == number), pyramid=pyramid)
    patch = background(frame, sitter.box, sitter.boxes, rng)
    kept, corner = around(frame, sitter.box)
    box, class_id = sitter.box - np.tile(corner, 2), np.array([number])
    scores = np.empty((len(OPPOSITE), len(SHARES), len(Part)))
    scores[:, 0] = scores_at(box[None], class_id, kept, own)
    for row, half in enumerate(OPPOSITE):
        for column in range(1, len(SHARES)):
            scores[row, column] = scores_at(box[None], class_id, painted(kept, box, half, SHARES[column], patch), own)
    return scores


def painted(frame: Frame, box: np.ndarray, half: Part, share: float, patch: np.ndarray) -> Frame:
    """The frame with a share of one half of a (4,) box behind something flat, `AHEAD` of all that the box shows.

    Args:
        frame: its depth stays where the box has no reading at all.
        box: xyxy, pixels from the image's outer edges, inside. A pixel belongs to the half that its centre is in.
        half: which is painted over, from its far side inwards.
        share: of that half's lines of pixels, 0 to 1.
        patch: (h, w, 3) uint8, colours for all pixels of the box.
    """
    there = _pixels(box)
    rows, columns = _pixels(part_box(box, half))
    if half in (Part.TOP, Part.BOTTOM):
        hidden = _outermost(rows, share, half == Part.TOP), columns
    else:
        hidden = rows, _outermost(columns, share, half == Part.LEFT)
    color, depth = frame.color.copy(), frame.depth.copy()
    over = color.copy()
    over[there] = patch
    color[hidden] = over[hidden]
    known = depth[there][np.isfinite(depth[there]) & (depth[there] > 0.0)]
    if len(known):
        depth[hidden] = max(float(known.min()) - AHEAD, NEAREST)
    return replace(frame, color=color, depth=depth)


def background(frame: Frame, box: np.ndarray, boxes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(h, w, 3) colours for all pixels of a box, from where the image shows least of (M, 4) boxes of objects."""
    height, width = frame.color[_pixels(box)].shape[:2]
    x = rng.integers(0, frame.color.shape[1] - width + 1, TRIES)
    y = rng.integers(0, frame.color.shape[0] - height + 1, TRIES)
    place = np.stack([x, y, x + width, y + height], axis=1)[:, None]
    sides = np.minimum(place[..., 2:], boxes[:, 2:]) - np.maximum(place[..., :2], boxes[:, :2])
    best = np.argmin(np.maximum(sides, 0.0).prod(axis=2).sum(axis=1))
    return frame.color[y[best] : y[best] + height, x[best] : x[best] + width]


def around(frame: Frame, box: np.ndarray) -> tuple[Frame, np.ndarray]:
    """The frame cut down to what is around a box, which is sooner looked at; and where it begins, (x, y) pixels."""
    k = frame.intrinsics
    reach = AROUND * np.max(box[2:] - box[:2])
    x0, y0 = (int(v) for v in np.maximum(np.floor(box[:2] - reach), 0.0))
    x1, y1 = (int(v) for v in np.minimum(np.ceil(box[2:] + reach), (k.width, k.height)))
    camera = replace(k, width=x1 - x0, height=y1 - y0, cx=k.cx - x0, cy=k.cy - y0)
    cut = replace(frame, color=frame.color[y0:y1, x0:x1], depth=frame.depth[y0:y1, x0:x1], intrinsics=camera)
    return cut, np.array([x0, y0])


def painted_table(scores: Sequence[np.ndarray]) -> str:
    """A row a share of one half: mean scores of that half's template, of the other half's, and of the whole one.

    An object counts with each of its four halves.
    """
    every = np.concatenate([np.zeros((0, len(OPPOSITE), len(SHARES), len(Part))), *scores])
    if not len(every):
        return "- No object is seen well."
    half, other = np.array(list(OPPOSITE)), np.array(list(OPPOSITE.values()))
    row = np.arange(len(half))
    rows = []
    for column, share in enumerate(SHARES):
        of = every[:, :, column]  # (N, 4, 5)
        means = (of[:, row, half].mean(), of[:, row, other].mean(), of[..., Part.WHOLE].mean())
        rows.append((f"{100 * share:.0f} %", len(of) * len(row), *(f"{value:.2f}" for value in means)))
    return table(("one half painted over", "halves", "its template", "the other half's", "the whole's"), rows)


def _pixels(box: np.ndarray) -> tuple[slice, slice]:
    """Rows and columns of the pixels whose centres are in a box, or on its upper or left edge."""
    x0, y0, x1, y1 = (int(v) for v in np.ceil(np.asarray(box) - 0.5))
    return slice(y0, y1), slice(x0, x1)


def _outermost(lines: slice, share: float, is_first: bool) -> slice:
    """A share of the lines, the first ones or the last."""
    count = round(share * (lines.stop - lines.start))
    return slice(lines.start, lines.start + count) if is_first else slice(lines.stop - count, lines.stop)
