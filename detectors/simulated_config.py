"""How good the simulated detector is."""

from __future__ import annotations

from dataclasses import dataclass

from ..datasets.errors import UserError

LIMITS = {  # least and greatest; widths and strengths divide, or are parameters that have to be positive
    "max_recall": (0.0, 1.0), "half_visibility": (0.0, 1.0), "visibility_width": (1e-3, 10.0),
    "half_side": (1e-3, 1e4), "side_width": (1e-3, 100.0), "mood": (0.0, 10.0), "mood_rate": (1e-3, 100.0),
    "score_visibility": (0.0, 1.0), "score_visibility_width": (1e-3, 10.0), "score_side": (1e-3, 1e4),
    "score_side_width": (1e-3, 100.0), "score_strength": (1e-2, 1e6), "min_score": (0.0, 1.0),
    "confusion_growth": (0.0, 1000.0), "stray_share": (0.0, 1.0), "split_strength": (1e-2, 1e6),
    "box_sigma": (0.0, 1.0), "box_growth": (0.0, 100.0), "box_tail": (2.1, 1e6), "background_spots": (0, 1000),
    "spot_chance": (0.0, 1.0), "spot_sharpness": (0.0, 1000.0), "chance_rate": (0.0, 100.0),
    "part_recall": (0.0, 1.0), "part_score": (1e-2, 1.0), "part_side": (1e-2, 10.0), "part_strip": (0.0, 1.0),
    "part_common": (0.0, 1.0), "part_confusion": (0.0, 100.0), "part_spots": (0.0, 10.0), "part_chance": (0.0, 100.0),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class SimulatedDetectorConfig:
    """How good the detector is. All numbers are own choices, in the range of small real-time detectors.

    Attributes:
        max_recall: chance to find a large, fully visible object.
        half_visibility: visible share at which half of the objects are found, and
        visibility_width: the logistic's width in visible share.
        half_side: pixels, root of the visible box's area at which half are found, and
        side_width: the logistic's width in octaves of it.
        mood: how much the viewing direction shifts the two logistics, in their own unit (standard deviation).
        mood_rate: radians of viewing direction over which that changes.
        score_range: mean score of objects hardly to be seen, and of large, fully visible ones.
        score_visibility: visible share at which the score has risen half way, and
        score_visibility_width: the logistic's width in visible share.
        score_side: pixels, root of the visible box's area, the same by size, and
        score_side_width: the logistic's width in octaves of it.
        score_strength: sum of the beta distribution's parameters; larger means less spread.
        min_score: detections whose best class scores less are not reported.
        confusions: pairs of classes and the mean share of the score the wrong one takes of a fully visible object.
        confusion_growth: factor by which that share has grown when nothing is visible.
        stray_share: mean share of every other class.
        split_strength: sum of the Dirichlet distribution's parameters.
        box_sigma: standard deviation of a box's side, as a share of the box's extent in that direction.
        box_growth: factor by which it has grown when nothing is visible.
        box_tail: degrees of freedom of Student's t, more than 2, without which it has no deviation.
        amodal: beta parameters of how far a side reaches from the visible part (0) to the whole object (1).
        background_spots: number of persistent false detections on surfaces; every thing of clutter is one more.
        spot_chance: chance of a detection of a spot from its best view.
        spot_sharpness: concentration of that chance about the best view; 8 halves it at 24 degrees.
        spot_score: beta parameters of a spot's score.
        chance_rate: false detections a frame that do not come again.
        chance_score: beta parameters of their score.
        chance_side: pixels, least and greatest side of their boxes.
        parts: whether templates of the four halves are scanned too; each is a detector of its own, whose numbers are
            those above times the factors below.
        part_recall: on `max_recall`.
        part_score: on all mean scores.
        part_side: on `half_side` and `score_side`, which for a half count its own pixels; with 0.71, the root of 1/2,
            halves would be found from as far away as whole objects.
        part_strip: on recall and score of the two halves that are cut along the object's longer side in the image.
        part_common: share of the variance of mood and luck that a half has in common with the whole; no factor.
        part_confusion: on the shares of wrong classes.
        part_spots: on `spot_chance`, for each of the four.
        part_chance: on `chance_rate`, for each of the four.

    Raises:
        UserError: a number outside its limits.
    """

    max_recall: float = 0.96
    half_visibility: float = 0.32
    visibility_width: float = 0.08
    half_side: float = 18.0
    side_width: float = 0.35
    mood: float = 0.8
    mood_rate: float = 0.35
    score_range: tuple[float, float] = (0.15, 0.84)
    score_visibility: float = 0.45
    score_visibility_width: float = 0.13
    score_side: float = 20.0
    score_side_width: float = 0.6
    score_strength: float = 22.0
    min_score: float = 0.05
    confusions: tuple[tuple[str, str, float], ...] = (
        ("cup", "bowl", 0.14),
        ("coffee mug", "bowl", 0.12),
        ("coffee mug", "soda can", 0.10),
        ("flashlight", "bottle", 0.12),
        ("flashlight", "soda can", 0.05),
        ("soda can", "bottle", 0.12),
        ("soda can", "cup", 0.10),
        ("cap", "bowl", 0.10),
        ("cereal box", "bottle", 0.04),
    )
    confusion_growth: float = 2.5
    stray_share: float = 0.012
    split_strength: float = 16.0
    box_sigma: float = 0.03
    box_growth: float = 2.5
    box_tail: float = 5.0
    amodal: tuple[float, float] = (1.2, 2.6)
    background_spots: int = 5
    spot_chance: float = 0.55
    spot_sharpness: float = 8.0
    spot_score: tuple[float, float] = (4.0, 8.0)
    chance_rate: float = 0.12
    chance_score: tuple[float, float] = (1.6, 9.0)
    chance_side: tuple[float, float] = (16.0, 130.0)
    parts: bool = False
    part_recall: float = 0.88
    part_score: float = 0.85
    part_side: float = 0.75
    part_strip: float = 0.8
    part_common: float = 0.6
    part_confusion: float = 1.6
    part_spots: float = 0.5
    part_chance: float = 2.0

    def __post_init__(self) -> None:
        for name, (low, high) in LIMITS.items():
            if not low <= (value := getattr(self, name)) <= high:
                raise UserError(f"detector simulated: expected {name} from {low} to {high}, found {value}; change it")
