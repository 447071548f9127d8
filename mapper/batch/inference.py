"""All hypothetical objects of a set of views: Algorithm 1 of Meger et al., Clutter; Explicit Occlusion, section 3."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...factors.evidence_model import EvidenceModel
from ...factors.size_prior import ClassSizePriors
from ..config import MapperConfig
from ..estimation.lifting import LiftedDetection
from ..estimation.view import View
from ..proposals.refinement import refine
from ..proposals.sampling import box_depths, class_shares, sample_volumes
from ..proposals.views import PackedViews, pack
from ..proposals.volumes import Volumes
from .scoring import VolumeLikelihood
from .sliding import occupied_points, slide_volumes
from .suppression import distinct, suppress, unexplained


@dataclass(frozen=True, slots=True, eq=False)
class Inference:
    """What came of it.

    Attributes:
        volumes: those that remain, the likeliest first.
        samples, sliding: numbers of volumes proposed.
        different: that were different after refinement, before suppression.
        suppressed: that a likelier one overlapped; `explained`: that had no detection of their own.
        iterations: (samples + sliding,) rounds of association and optimisation of those that found a detection.
        unsettled: of them, those whose association still changed after the last round.
    """

    volumes: Volumes
    samples: int
    sliding: int
    different: int
    suppressed: int
    explained: int
    iterations: np.ndarray
    unsettled: int

    def summary(self) -> dict[str, float]:
        """JSON-able numbers for the report."""
        rounds = self.iterations if len(self.iterations) else np.zeros(1)
        return {
            "samples": self.samples,
            "sliding_volumes": self.sliding,
            "before_suppression": self.different,
            "after_suppression": self.different - self.suppressed,
            "with_own_detections": len(self.volumes),
            "iterations_median": float(np.median(rounds)),
            "iterations_most": int(rounds.max()),
            "not_settled": self.unsettled,
        }


def infer_volumes(
    views: Sequence[View],
    detections: Sequence[Sequence[LiftedDetection]],
    model: EvidenceModel,
    priors: ClassSizePriors,
    config: MapperConfig,
) -> Inference:
    """The objects that explain the views best, each with its class, place and size.

    Args:
        views: of one camera and one upright frame, with depth; at least one.
        detections: of each view.
        model, priors: of the detector's classes.
        config: every number; `config.seed` makes the samples.
    """
    found = [d for view in detections for d in view]
    own = [model.scores.evidence(d.scores, 0.0, d.part).own for d in found]
    poses, upright = [view.T_world_camera for view in views], views[0].R_world_upright
    packed = pack(poses, detections, own, upright, views[0].frame.intrinsics, config.association)
    scores = np.array([d.scores for d in found]).reshape(len(found), len(priors.classes))
    samples = _sample(views, found, packed, scores, model, priors, config)
    occupied = occupied_points([view.frame.depth for view in views], poses, views[0].frame.intrinsics)
    sliding = slide_volumes(packed, occupied, scores, priors, config.batch.sliding_spacing, config.association.gate)
    refined = refine(
        Volumes.concatenate(samples, sliding), packed, priors, config.association, config.batch.max_iterations
    )
    potential = config.batch.score_potential
    likelihood = VolumeLikelihood(packed, found, model, priors, config.evidence, config.association, potential)
    different = likelihood.score(distinct(refined), views)
    best = suppress(different, upright, config.batch.overlap)
    remaining = unexplained(best)
    tried = refined.iterations > 0
    return Inference(
        volumes=remaining,
        samples=len(samples),
        sliding=len(sliding),
        different=len(different),
        suppressed=len(different) - len(best),
        explained=len(best) - len(remaining),
        iterations=refined.iterations[tried],
        unsettled=int(np.count_nonzero(tried & ~refined.settled)),
    )


def _sample(
    views: Sequence[View],
    found: Sequence[LiftedDetection],
    packed: PackedViews,
    scores: np.ndarray,
    model: EvidenceModel,
    priors: ClassSizePriors,
    config: MapperConfig,
) -> Volumes:
    share, offset = config.lifting.central_share, config.lifting.surface_offset
    depths = [
        box_depths(views[v].frame.depth, d.whole_xyxy, d.xyxy, share) for v, d in zip(packed.view, found, strict=True)
    ]
    # Platt's probabilities, because scores of different templates do not compare
    confidence = np.array([float(model.scores.platt(np.array(d.confidence), d.part)) for d in found])
    rng = np.random.default_rng(config.seed)
    args = packed, depths, class_shares(scores), confidence, priors, config.batch.samples
    return sample_volumes(*args, offset, rng)
