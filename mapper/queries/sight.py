"""What can be seen from where, and from where to look next."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...datasets.errors import UserError
from ..map.thing import Thing
from .names import NameQuestions

if TYPE_CHECKING:
    from ...datasets.frame import Intrinsics
    from .sightings import ExpectedDetection, Sighting
    from .viewpoints import Viewpoint

SEEN_SHARE = 0.3  # of a thing: with less in sight a detector responds "as if no object was present" (Clutter, IV)
ROTATION_TOLERANCE = 1e-3  # of R' R against the identity


class SightQuestions(NameQuestions):
    """Questions about views. Their modules are imported with the first question: they need compiled kernels."""

    __slots__ = ()

    def visible_from(
        self,
        T_world_camera: np.ndarray,
        camera: Intrinsics | None = None,
        label: str | None = None,
        *,
        min_share: float = SEEN_SHARE,
    ) -> list[Sighting]:
        """Things that can be seen from a place, likeliest first.

        A thing is hidden by things that are more likely there than not, and by the map's cloud where it was read with
        one (`cloud`); without a cloud nothing else hides it: walls and furniture that are no things do not.

        Args:
            T_world_camera: (4, 4) where the camera is.
            camera: that looks; the one that mapped, if not given.
            label: only things that may be one, in words as for `find`, or the one that has this name; None for things
                of any class.
            min_share: of a thing that must be in the image and not hidden for it to count as seen, in (0, 1].

        Raises:
            UserError: no camera is known.
            InputError: the map's cloud is damaged.
            ValueError: the pose is none, or the share is not in (0, 1].
        """
        if not 0.0 < min_share <= 1.0:
            raise ValueError(f"min_share must be above 0 and at most 1, but got {min_share}")
        from .sightings import sightings

        return sightings(self, _pose(T_world_camera), self._camera_or(camera), self.belief_of(label), min_share)

    def expected_at(self, T_world_camera: np.ndarray, camera: Intrinsics | None = None) -> list[ExpectedDetection]:
        """What the map's detector should find from a place, likeliest first, each with its box in the image:

            P(detected) = P(it exists) Σ_c p(c) E[P_D(c, visible share, side in pixels)]

        with P_D of the evidence model that the map was made with (`factors/detection_model.py`) and the mean over where
        the thing may be. What hides things is as for `visible_from`.

        Args:
            T_world_camera: (4, 4) where the camera is.
            camera: that looks; the one that mapped, if not given.

        Raises:
            UserError: no camera is known.
            InputError: the map's cloud, configuration or evidence model is damaged.
            ValueError: the pose is none.
        """
        from .sightings import expected_detections

        return expected_detections(self, _pose(T_world_camera), self._camera_or(camera))

    def where_to_look(
        self,
        what: Thing | str,
        count: int = 5,
        camera: Intrinsics | None = None,
        *,
        candidates: np.ndarray | None = None,
    ) -> list[Viewpoint]:
        """The viewpoints from which a look should tell most, the best first.

        Of a label: bits about which things are one, summed over the things in view. Of a thing: bits about whether it
        exists and what it is. The gain is the mutual information of that and of what the detector will say (nothing, or
        a class with a score), as `information_gain.py` has it, times the share of the look that is new: what was seen
        from there already (by the mapper, or from a better viewpoint of this answer) tells little again. So a gain is
        that of a look after those before it in the list.

        Viewpoints are poses of the run's trajectory, where the map was read from its folder, and places on rings around
        the things in question that are free as far as the map knows. The list is shorter, or empty, where no other
        viewpoint tells anything: a thing that is sure already leaves nothing to learn.

        Args:
            what: a thing, its id or its given name; else a label or labels, in words as for `find`.
            count: how many at most.
            camera: that looks; the one that mapped, if not given.
            candidates: (M, 4, 4) `T_world_camera` to choose from, in place of the above.

        Raises:
            UserError: no camera is known; `what` is no thing of this map, nor are its words a label.
            InputError: a file of the run is damaged.
            ValueError: a pose is none, or `count` is below 1.
        """
        if count < 1:
            raise ValueError(f"count must be at least 1, but got {count}")
        from .next_views import next_views

        subject = self.thing(what) if isinstance(what, Thing) else next(iter(self.called(what)), None)
        labels = self.labels_of(str(what)) if subject is None else None
        poses = None if candidates is None else np.array([_pose(T) for T in candidates]).reshape(-1, 4, 4)
        return next_views(self, subject, labels, count, self._camera_or(camera), poses)

    def _camera_or(self, camera: Intrinsics | None) -> Intrinsics:
        chosen = camera or self.camera
        if chosen is None or chosen.width < 1:
            raise UserError(
                f"the map of {self.source} does not know its camera; say which one looks (Intrinsics: size, focal "
                "lengths and principal point in pixels), or map again with `thingmap run`"
            )
        return chosen


def _pose(T_world_camera: np.ndarray) -> np.ndarray:
    T = np.array(T_world_camera, dtype=np.float64)
    if T.shape != (4, 4) or not np.all(np.isfinite(T)):
        raise ValueError(f"T_world_camera must be a (4, 4) matrix of finite numbers, but got {T_world_camera!r}")
    R = T[:3, :3]
    rigid = np.allclose(R.T @ R, np.eye(3), atol=ROTATION_TOLERANCE) and np.linalg.det(R) > 0.0
    if not rigid or not np.allclose(T[3], [0.0, 0.0, 0.0, 1.0]):
        raise ValueError(f"T_world_camera must be a rotation and a translation, but got {T.tolist()}")
    return T
