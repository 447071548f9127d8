"""Numbers of learning: what counts as a sample, and how far few samples are trusted."""

from __future__ import annotations

from dataclasses import dataclass

from ..config import LiftingConfig


@dataclass(frozen=True, slots=True)
class LearningConfig:
    """How samples are collected and fitted.

    Attributes:
        min_confidence: detections below it are not looked at, as the mapper does not look at them.
        overlap: intersection over union with an object's box from which a detection may show it ("significant overlap";
            Meger et al., Clutter, section IV). Lower than the usual 0.5: boxes of half hidden objects lie between what
            is seen and the whole.
        max_missing: objects of which a larger share has no depth are left out: nobody knows what of them is hidden.
        pseudo_votes: what the pooled class counts for in a bin of a class, and how many trials a knot of P_D needs.
            Scores of one class spread by 0.15, means of classes by 0.05: the ratio of the variances is 9 independent
            votes, and neighbouring views share half of their errors.
        sigma_floor: least standard deviation of a score; narrower, one unlucky score would decide.
        other_floor: the same for the scores of wrong classes.
        class_ridge: penalty on a class's deviation in the logit of P_D: a prior of standard deviation 1.
        pooled_ridge: the same of the pooled class from the generic model, of standard deviation 4.5: it keeps the rate
            of a template that never finds anything finite, and hardly moves any other.
        curvature: penalty on second differences of what the logit's curves add to the generic ones: a prior of standard
            deviation 2 on the change of slope from knot to knot, which only counts where there are few trials.
        slope: the same on first differences, of standard deviation 4.
        folds: of the cross-validation; whole sequences are left out.
    """

    min_confidence: float = LiftingConfig().min_confidence
    overlap: float = 0.4
    max_missing: float = 0.5
    pseudo_votes: float = 20.0
    sigma_floor: float = 0.05
    other_floor: float = 0.01
    class_ridge: float = 1.0
    pooled_ridge: float = 0.05
    curvature: float = 0.25
    slope: float = 0.06
    folds: int = 5
