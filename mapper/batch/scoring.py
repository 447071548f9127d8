"""How likely hypothetical objects are, given all views.

Meger et al., Explicit Occlusion, equations (3) and (4), and Clutter, equation (1): a size prior times, for each view,
the likelihoods of its depth and of its appearance. In log ratios against "there is none, but what looks like one":

    L(o) = log N(s; mu_k, Sigma_k) / N(s; mu_0, Sigma_0) + Σ_t [ depth_t + log Σ_i w_ti A_ti ]
    w_ti = v_ti 1[v_ti > theta] / Σ_j v_tj 1[v_tj > theta]
    A_ti = Psi_s Psi_g        where template i found it: score ratio, given its occlusion, times alignment
         = 1 - P_D(k, v_ti)   where it did not: near 1 where nobody would have expected it to

Psi_s is the learned density ratio, or one of the two that Explicit Occlusion names (section 2.3): exp of a score mapped
linearly to [-1, 1], or the odds of Platt's probability. Neither knows what is hidden; that is left to w.

A view in which no template shows enough says nothing of appearance. Hypotheses are ranked by L; whether a landmark
exists is decided by the joint graph.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import logit

from ...datasets.frame import Intrinsics
from ...detectors.parts import part_box
from ...factors.evidence_model import EvidenceModel
from ...factors.size_prior import ClassSizePriors
from ...factors.solid import project_solids
from ...factors.visibility import Visibility, VolumePart, measure_visibility
from ..config import AssociationConfig, EvidenceConfig, ScorePotential
from ..estimation.association_costs import box_sides
from ..estimation.lifting import LiftedDetection
from ..estimation.looks import template_weights
from ..estimation.view import View
from ..proposals.views import PackedViews
from ..proposals.volumes import Volumes

OCCLUSION_STEP = 0.05  # scores are read at multiples of this occlusion: half of a bin of the score model
LEAST = 1e-6  # of a view's likelihood ratio, so that no single view rules a hypothesis out


class VolumeLikelihood:
    """The likelihood of hypotheses in some views.

    Args:
        views: the views, packed.
        detections: D of them, in the same order.
        model: what is learned of the detector, of its own classes.
        priors: of the classes' sizes.
        config: which kinds of evidence are in use.
        alignment: variances of Psi_g.
        potential: which Psi_s.
    """

    def __init__(
        self,
        views: PackedViews,
        detections: Sequence[LiftedDetection],
        model: EvidenceModel,
        priors: ClassSizePriors,
        config: EvidenceConfig,
        alignment: AssociationConfig,
        potential: ScorePotential = ScorePotential.OCCLUSION,
    ) -> None:
        self._views, self._detections, self._model, self._priors = views, detections, model, priors
        self._config, self._alignment, self._potential = config, alignment, potential
        self._read: dict[tuple[int, int], np.ndarray] = {}

    def score(self, volumes: Volumes, views: Sequence[View]) -> Volumes:
        """The volumes with their `log_likelihood`; `views` are those of `PackedViews`, with depth."""
        total = self.log_size_ratio(volumes)
        for v, view in enumerate(views):
            total = total + self._view_term(volumes, v, view)
        return replace(volumes, log_likelihood=total)

    def log_size_ratio(self, volumes: Volumes) -> np.ndarray:
        """(N,) nats: the size under its class's prior against that of no object."""
        return self._log_normal(volumes, volumes.class_id + 1) - self._log_normal(volumes, 0 * volumes.class_id)

    def _log_normal(self, volumes: Volumes, row: np.ndarray) -> np.ndarray:
        covariance = self._priors.covariance[row]
        away = volumes.log_size - self._priors.mean[row]
        squared = np.einsum("ni,ni->n", away, np.linalg.solve(covariance, away[:, :, None])[:, :, 0])
        return -0.5 * (squared + np.linalg.slogdet(covariance)[1])

    def _view_term(self, volumes: Volumes, v: int, view: View) -> np.ndarray:
        k = view.frame.intrinsics
        camera = view.T_world_camera, view.R_world_upright
        visibility = measure_visibility(view.frame.depth, k, *camera, volumes.position, volumes.log_size)
        if not self._config.occlusion:
            visibility = visibility.as_if_clear()
        sides, _ = project_solids(*camera, volumes.position, volumes.log_size, k)
        weights = template_weights(visibility.visible, self._views.templates)
        ratio = self._template_ratios(volumes, v, sides, visibility, k)
        told = weights.sum(axis=1) > 0.0
        appearance = np.where(told, np.log(np.maximum((weights * ratio).sum(axis=1), LEAST)), 0.0)
        return appearance + self._depth_term(visibility)

    def _template_ratios(
        self, volumes: Volumes, v: int, sides: np.ndarray, visibility: Visibility, intrinsics: Intrinsics
    ) -> np.ndarray:
        """(N, 5) A_ti of one view."""
        visible, known = visibility.visible, 1.0 - visibility.missing
        is_class = np.eye(len(self._priors.classes))[volumes.class_id]
        side_px = box_sides(_clip(sides, intrinsics))
        ratio = np.ones((len(volumes), len(VolumePart)))
        for part in map(int, np.flatnonzero(self._views.templates)):
            found = volumes.detection_of[:, v, part]
            if self._config.misses:
                chance = self._model.detection.probability(visible[:, part], side_px, part, is_class)
                ratio[:, part] -= known[:, part] * chance
            shown = np.flatnonzero(found >= 0)
            if not len(shown):
                continue
            boxes = _clip(part_box(sides[shown], part), intrinsics)
            aligned = self._alignment_density(self._views.xyxy[found[shown]], boxes)
            for n, psi_g in zip(shown, aligned, strict=True):
                psi_s = self._score_ratio(int(found[n]), 1.0 - visible[n, part])[volumes.class_id[n]]
                ratio[n, part] = psi_g * np.exp(psi_s)
        return ratio

    def _alignment_density(self, detected: np.ndarray, boxes: np.ndarray) -> np.ndarray:
        """(N,) Psi_g of N pairs of (N, 4) boxes; 1 where they are the same."""
        scale, size = box_sides(detected), box_sides(boxes)
        shift = (boxes[:, :2] + boxes[:, 2:] - detected[:, :2] - detected[:, 2:]) / (2.0 * scale[:, None])
        with np.errstate(divide="ignore"):
            ratio = np.log(size / scale)
        c = self._alignment
        return np.exp(-0.5 * ((shift**2).sum(axis=1) / c.centre_variance + ratio**2 / c.scale_variance))

    def _score_ratio(self, detection: int, occlusion: float) -> np.ndarray:
        """(K,) log Psi_s of an object of each class; learned, against what merely looks like some class."""
        key = detection, round(occlusion / OCCLUSION_STEP)
        if key not in self._read:
            # 14 * 0.05 > 0.7
            self._read[key] = self._read_scores(self._detections[detection], round(key[1] * OCCLUSION_STEP, 6))
        return self._read[key]

    def _read_scores(self, detection: LiftedDetection, occlusion: float) -> np.ndarray:
        model, scores, part = self._model.scores, detection.scores, detection.part
        if self._potential is ScorePotential.LINEAR:
            return model.linear(np.nan_to_num(scores), part)
        if self._potential is ScorePotential.PLATT:
            return logit(np.clip(model.platt(np.nan_to_num(scores), part), LEAST, 1.0 - LEAST))
        read = model.evidence(scores, occlusion, part)
        return read.own - (np.logaddexp.reduce(read.background) - np.log(len(read.background)))

    def _depth_term(self, visibility: Visibility) -> np.ndarray:
        """(N,) nats: mean log ratio of the depth readings, as far as the volume is seen."""
        if not self._config.depth:
            return np.zeros(len(visibility.pixels))
        whole = VolumePart.WHOLE
        return visibility.depth_log_ratio[:, whole] * visibility.told[:, whole]


def _clip(boxes: np.ndarray, intrinsics: Intrinsics) -> np.ndarray:
    k = intrinsics
    return np.clip(boxes, -0.5, np.array([k.width, k.height, k.width, k.height]) - 0.5)
