"""The camera's graph, of which some frames are views whatever the motion, and whose estimate objects may improve."""

from __future__ import annotations

from ...datasets.frame import Frame
from ..estimation.smoother import Smoother
from ..trajectory.camera import CameraGraph
from ..trajectory.keyframes import KeyframeSelector


class ViewCamera(CameraGraph):
    """As `CameraGraph`; a view always becomes a keyframe."""

    def track_view(self, frame: Frame) -> None:
        """Registers a frame that is to become a keyframe (`add_keyframe`).

        Raises:
            BrokenFrame: as `track`.
        """
        self._selector = KeyframeSelector(self._config.keyframes)  # a fresh one takes whatever comes
        self.track(frame)

    def with_objects(self) -> Smoother:
        """A smoother of its own, solved, with all that the camera has measured; the camera's stays as it is."""
        config = self._config.smoother, self.intrinsics, self._config.up.upright_tolerance
        return Smoother.from_ledger(self.smoother.ledger, *config)

    def read_from(self, smoother: Smoother) -> Smoother:
        """Answers with another estimate of the same keyframes from now on; returns the one before."""
        before, self._smoother = self.smoother, smoother
        return before
