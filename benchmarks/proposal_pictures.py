"""Pictures of what the proposal detector finds: planes darkened and tinted, each proposal in a colour of its own."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from thingmap.datasets.frame import Frame
from thingmap.detectors.proposals.config import ProposalConfig
from thingmap.detectors.proposals.objectness import proposal_features, shipped_objectness
from thingmap.detectors.proposals.proposals import Proposals

PLANE_TINTS = np.array([[70, 70, 70], [0, 60, 90], [90, 60, 0], [60, 0, 90], [0, 90, 30]], dtype=np.uint8)  # RGB


def draw(frame: Frame, found: Proposals, config: ProposalConfig, confidence: float) -> np.ndarray:
    """(H, 2 W, 3) uint8 RGB: the image, and beside it the planes and proposals.

    Proposals that are things with at least `confidence` have a white box with their probability, the others none.
    """
    shades = np.random.default_rng(0).integers(60, 255, (max(len(found), 1), 3)).astype(np.uint8)
    picture = frame.color // 2
    owner = found.grid.enlarged(found.planes.owner)
    on_plane = owner >= 0
    picture[on_plane] = picture[on_plane] // 2 + PLANE_TINTS[owner[on_plane] % len(PLANE_TINTS)]
    on = found.labels >= 0
    picture[on] = frame.color[on] // 3 + shades[found.labels[on]] // 3 * 2
    picture = np.ascontiguousarray(picture)
    probability = shipped_objectness()(proposal_features(found, config))
    for box, p in zip(found.xyxy.astype(int).tolist(), probability, strict=True):
        if p >= confidence:
            cv2.rectangle(picture, box[:2], (box[2] - 1, box[3] - 1), (255, 255, 255), 1)
            cv2.putText(
                picture, f"{p:.2f}", (box[0] + 2, box[1] + 11), cv2.FONT_HERSHEY_SIMPLEX, 0.38, (255, 255, 0), 1
            )
    return np.hstack([frame.color, picture])


def write(path: Path, picture: np.ndarray) -> None:
    """An RGB picture as PNG; the folder is made."""
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), picture[..., ::-1])
