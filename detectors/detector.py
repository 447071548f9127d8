"""What a detector is: one call."""

from __future__ import annotations

from typing import Protocol

from ..datasets.frame import Frame
from .detections import Detections


class Detector(Protocol):
    """Any callable from a frame to its detections; a plain function serves.

    One of which it is known what its scores are worth may say so by an attribute `evidence_model`: a name or a file, as
    `evidence: model:` of a configuration, which comes before it.
    """

    def __call__(self, frame: Frame, /) -> Detections: ...


def find_nothing(frame: Frame, /) -> Detections:
    """The detector of `none`: odometry and geometry without any boxes."""
    return Detections.empty(())
