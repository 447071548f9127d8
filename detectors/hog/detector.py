"""Sliding windows as a detector: boxes with full score vectors, parts, and probability maps."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ...datasets.errors import UserError
from ...datasets.frame import Frame
from ..boxes import cut_to_image
from ..detections import Detections, Part
from ..probability_maps import ProbabilityMaps
from ..selection import check_selection
from .candidates import Candidates, ScoredLevel, candidates, corner_boxes, scored_levels, without_lesser
from .maps import MapConfig, probability_maps
from .model import HogModel, HogTemplate, load_model, shipped_model
from .pyramid import build_pyramid
from .refinement import ClassBoxes
from .score_vectors import score_vectors
from .scoring import Scorer
from .second_stage.judged import JudgedWindows, proposed_windows
from .suppression import suppress

SHIPPED = "hog"  # name of what is known of the shipped model


@dataclass(frozen=True, slots=True, eq=False)
class HogDetector:
    """HOG templates on colour and depth (Lai et al. 2012, III-C), and of object halves (Explicit Occlusion, 4.1).

    Every detection carries the scores of all classes (see `score_vectors`). The same frame gives the same detections.
    Where the model has a second stage, templates of whole objects only propose windows: which class each shows, if any,
    and where the object's box is, the second stage says. Halves are by their templates alone.

    An image too small for any window has none. A box of an object that reaches over the image's edge is cut there.
    Pixels without a reading are filled for the depth HOG and count nothing in the histograms, also where that is all
    pixels: only a frame without a depth image at all cannot be looked at by a model that uses depth.

    Attributes:
        model: a model, or its file; None for the one that is shipped. Afterwards it is the model.
        confidence: least probability of a box's own class; low, since the mapper weighs evidence, it does not trust it.
        nms_iou: intersection over union above which the lesser of two boxes of the same part goes, whatever their
            classes (see `suppression`). Below a half, since a window of twice the size may answer to the same object:
            on rendered tables not learned from, 0.4 left a quarter fewer boxes than 0.5, found as many objects (353 and
            354 times) and was the more precise (mean AP 0.69 against 0.66).
        max_detections: most boxes kept of each part, the best ones.
        parts: whether half templates are used besides whole ones.
        merge: one box at a place, with the scores of all classes there. Without, the boxes of every class as if it had
            a detector to itself, with its own score only (NaN for the others): for precision and recall by class.
        maps: how `detect_dense` makes its maps.
        evidence_model: what the mapper shall know of it: "hog" of the shipped model; of another's file FILE.npz the
            FILE.evidence.json beside it, if `thingmap learn` has written one there; else nothing, "".

    Raises:
        InputError: for a file that is not a model.
        UserError: for an option out of range.
    """

    model: HogModel | Path | str | None = None
    confidence: float = 0.1
    nms_iou: float = 0.4
    max_detections: int = 100
    parts: bool = True
    merge: bool = True
    maps: MapConfig = field(default_factory=MapConfig)
    evidence_model: str = field(init=False)
    _templates: tuple[HogTemplate, ...] = field(init=False, repr=False)
    _scorer: Scorer | None = field(init=False, repr=False)
    _corners: np.ndarray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        check_selection(self.confidence, self.max_detections, self.nms_iou)
        model, known = self.model, ""
        if not isinstance(model, HogModel):
            known = SHIPPED if model is None else _evidence_beside(Path(model))
            model = load_model(shipped_model() if model is None else model)
        templates = tuple(t for t in model.templates if self.parts or t.part == Part.WHOLE)
        scorer = Scorer(templates) if templates else None
        made = {
            "model": model,
            "evidence_model": known,
            "_templates": templates,
            "_scorer": scorer,
            "_corners": corner_boxes(templates),
        }
        for name, value in made.items():
            object.__setattr__(self, name, value)

    @property
    def classes(self) -> tuple[str, ...]:
        """K class names, as in all detections."""
        assert isinstance(self.model, HogModel)
        return self.model.classes

    def __call__(self, frame: Frame, /) -> Detections:
        """Detections of a frame, best first.

        Raises:
            UserError: for a frame without a depth image, if the model uses depth.
        """
        levels, judged = self._looked(frame)
        return self._detections(self._by_templates(levels, judged, frame), levels, judged, frame)

    def detect_dense(self, frame: Frame, /) -> tuple[Detections, ProbabilityMaps]:
        """The same detections, and the probability maps of the whole objects' templates.

        Raises:
            UserError: as a call.
        """
        levels, judged = self._looked(frame)
        found = self._by_templates(levels, judged, frame)
        whole = self._of_each_class(found, judged)
        whole = whole.select(whole.part == Part.WHOLE)
        boxes = ClassBoxes(whole.class_id, _clipped(whole.xyxy, frame), whole.probability)
        maps = probability_maps(
            levels, self._templates, self.classes, frame, boxes, self.maps, judged=judged is not None
        )
        return self._detections(found, levels, judged, frame), maps

    def _looked(self, frame: Frame) -> tuple[list[ScoredLevel], JudgedWindows | None]:
        """Scores of all windows at all scales, and what the second stage says of those that may show a whole object."""
        model = self.model
        assert isinstance(model, HogModel)
        depth = frame.depth if model.channels.use_depth else None
        if depth is not None and depth.shape != frame.color.shape[:2]:
            found = f"depth of shape {depth.shape} beside colour of shape {frame.color.shape[:2]}"
            raise UserError(
                f"frame {frame.name}: the HOG model looks at depth ({model.channels}), but there is {found}; "
                "use a model trained with --channels rgb"
            )
        if self._scorer is None:
            return [], None
        focal = float(np.sqrt(frame.intrinsics.fx * frame.intrinsics.fy))
        pyramid = build_pyramid(frame.color, depth, focal, model.channels, model.pyramid)
        levels = scored_levels(pyramid, self._scorer, self._corners)
        if model.second_stage is None:
            return levels, None
        proposed = proposed_windows(levels, self._templates, pyramid.width, pyramid.height)
        return levels, JudgedWindows.of(model.second_stage, pyramid, frame.depth, focal, proposed)

    def _by_templates(self, levels: list[ScoredLevel], judged: JudgedWindows | None, frame: Frame) -> Candidates:
        """What templates find of each class and part for itself; of whole objects, only if there is no second stage."""
        parts = tuple(part for part in Part if judged is None or part != Part.WHOLE)
        found = candidates(levels, self._templates, self.confidence, parts)
        height, width = frame.color.shape[:2]
        return without_lesser(found, width, height, self.nms_iou, self.max_detections)

    def _of_each_class(self, found: Candidates, judged: JudgedWindows | None) -> Candidates:
        """What is found of each class and part for itself, by templates and by the second stage."""
        if judged is None:
            return found
        return judged.of_each_class(self.confidence, self.nms_iou, self.max_detections).joined(found)

    def _detections(
        self, found: Candidates, levels: list[ScoredLevel], judged: JudgedWindows | None, frame: Frame
    ) -> Detections:
        """What is left of what templates have found and the second stage has judged, with its scores."""
        if not self.merge:
            found = self._of_each_class(found, judged)
            scores = np.full((len(found), len(self.classes)), np.nan)
            scores[np.arange(len(found)), found.class_id] = found.probability
            return _sorted(self.classes, _clipped(found.xyxy, frame), scores, found.part)
        found = found.select(suppress(_clipped(found.xyxy, frame), found.part, self.nms_iou, self.max_detections))
        boxes, part = _clipped(found.xyxy, frame), found.part
        scores = score_vectors(found, levels, self._templates, len(self.classes), self.nms_iou)
        if judged is not None:
            whole = judged.merged(self.confidence, self.nms_iou, self.max_detections)
            boxes, scores = np.concatenate([whole.xyxy, boxes]), np.concatenate([whole.scores, scores])
            part = np.concatenate([np.full(len(whole.xyxy), Part.WHOLE, part.dtype), part])
        return _sorted(self.classes, boxes, scores, part)


def _sorted(classes: tuple[str, ...], xyxy: np.ndarray, scores: np.ndarray, part: np.ndarray) -> Detections:
    order = np.argsort(-np.nanmax(scores, axis=1, initial=0.0), kind="stable")
    return Detections(classes, xyxy[order], scores[order], part[order])


def _evidence_beside(model: Path) -> str:
    file = model.with_suffix(".evidence.json")
    return str(file) if file.is_file() else ""


def _clipped(xyxy: np.ndarray, frame: Frame) -> np.ndarray:
    return cut_to_image(xyxy, frame.color.shape[1], frame.color.shape[0])
