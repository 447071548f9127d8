"""Links across a stretch that nothing measured: no estimate can refuse one, so they must agree with each other."""

from __future__ import annotations

import numpy as np

from ..rigid import inverse, rotation_angle
from .link_jobs import LinkFound, LinkKind

AGREEMENT = (0.1, 0.15)  # rad, m: two right links err by centimetres, look-alike places lie elsewhere
KEPT = 50  # the latest; right ones come several in a row


class Unconfirmed:
    """Holds links back until one from another keyframe asks for the same correction."""

    def __init__(self) -> None:
        self._waiting: list[tuple[LinkFound, np.ndarray]] = []  # with the correction of the world that each asks for

    def confirmed(self, link: LinkFound, poses: np.ndarray) -> list[LinkFound]:
        """The link and those that it confirms, under the present (M, 4, 4) poses; none while it stands alone.

        Links between neighbours by depth need no second: it was known how they lie when they were looked for.
        """
        if link.kind is LinkKind.NEAR:
            return [link]
        correction = poses[link.a] @ link.motion.T_a_b @ inverse(poses[link.b])
        agreeing = [
            other
            for other, asked in self._waiting
            if other.b != link.b and _alike(asked @ poses[link.b], correction @ poses[link.b])
        ]
        if not agreeing:
            self._waiting = [*self._waiting[1 - KEPT :], (link, correction)]
            return []
        self._waiting = [(one, asked) for one, asked in self._waiting if one not in agreeing]
        return [*agreeing, link]


def _alike(T: np.ndarray, T_other: np.ndarray) -> bool:
    off = inverse(T) @ T_other
    return bool(rotation_angle(off[:3, :3]) < AGREEMENT[0] and np.linalg.norm(off[:3, 3]) < AGREEMENT[1])
