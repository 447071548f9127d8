"""Hypotheses of all classes given to proposals: the scores by which proposals are told apart (section III-A)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..boxes import box_ious
from .codebook import Codebook
from .hypotheses import Hypotheses


def class_scores(
    hypotheses: Sequence[Hypotheses], codebooks: Sequence[Codebook], xyxy: np.ndarray, min_iou: float
) -> tuple[np.ndarray, np.ndarray]:
    """What every class says of every proposal.

    A hypothesis is for the proposal whose box it overlaps most, and for none where that is less than `min_iou`. Of
    several of a class the best counts. Scores are normalised by the class's edge points, (s - mu) / sigma.

    Args:
        hypotheses: C of them, one for each class.
        codebooks: of the classes.
        xyxy: (N, 4) boxes of the proposals.
        min_iou: intersection over union.

    Returns:
        (N, C) normalised scores, NaN where no hypothesis is for the proposal, and (N, C, 4) boxes of the hypotheses,
        NaN likewise.
    """
    scores = np.full((len(xyxy), len(codebooks)), np.nan)
    boxes = np.full((len(xyxy), len(codebooks), 4), np.nan)
    if len(xyxy) == 0:
        return scores, boxes
    for number, (found, book) in enumerate(zip(hypotheses, codebooks, strict=True)):
        if len(found) == 0:
            continue
        overlap = box_ious(found.xyxy, xyxy)
        closest = overlap.argmax(axis=1)
        kept = np.flatnonzero(overlap[np.arange(len(found)), closest] >= min_iou)
        for h in kept[np.argsort(found.score[kept], kind="stable")]:  # the best one last: it stays
            scores[closest[h], number] = (found.score[h] - book.edge_mean) / book.edge_std
            boxes[closest[h], number] = found.xyxy[h]
    return scores, boxes
