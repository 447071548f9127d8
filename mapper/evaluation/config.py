"""Every number of the evaluator. They are frozen with `VERSION`: change both together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class EvaluationConfig:
    """What counts as right; nothing here may be tuned to a map.

    Attributes:
        aliases: a label of the map -> what the truth calls it.
        frame_step: images are judged in every n-th frame (Georgakis et al., section IV: 5).
        box_iou: intersection over union at which a box is found (Everingham et al., PASCAL VOC: 0.5).
        min_visibility: visible share below which an object is nobody's fault: neither to be found nor a false positive.
        believed: existence times probability of the class at which a thing counts as claimed.
        distance_share: of an object's diagonal: centres nearer than this may be the same (0.5: the thing's centre lies
            in the ball about the object), or nearer than its `tolerance` where that is more.
        max_distance: metres, the same for objects of unknown size without a tolerance.
        volume_iou: of upright boxes, at which a thing may be an object in the matching by volume (Song et al.,
            SUN RGB-D: 0.25).
        point_distance: metres from a labelled true point at which a point of the map takes its label.
        path_lengths: numbers of views after which the map is judged in the next one (Meger et al., Clutter, VI-C), and
        explicit_lengths: the same for average precision (Meger et al., Explicit Occlusion, figure 6).
        calibration_bins: equal bins of reliability diagrams.
        seen_visibility: an object that was never visible by this share, nor
        seen_side: never larger than this in pixels (root of its visible box's area), need not be in a map.
        max_time_difference: seconds between stamps of the same frame.
        worst_cases: how many are shown of each kind.
    """

    aliases: Mapping[str, str] = field(default_factory=dict)
    frame_step: int = 5
    box_iou: float = 0.5
    min_visibility: float = 0.25
    believed: float = 0.5
    distance_share: float = 0.5
    max_distance: float = 0.15
    volume_iou: float = 0.25
    point_distance: float = 0.03
    path_lengths: tuple[int, ...] = (3, 7, 10, 12)
    explicit_lengths: tuple[int, ...] = (2, 3, 4, 5, 6)
    calibration_bins: int = 10
    seen_visibility: float = 0.25
    seen_side: float = 16.0
    max_time_difference: float = 0.01
    worst_cases: int = 6
