"""Under, inside and beside: how probably one uncertain box has each of these places relative to another.

Each function takes pairs and gives (P,) P(both things exist and the first is there), the share of the draws in which it
is. Some things are hollow below a flat top and stand on legs, such as tables: what is in their box is under them, not
inside. A map's boxes cannot tell a table from a chest, so the class of the thing has to (`synonyms.yaml`).
"""

from __future__ import annotations

import numpy as np

from .relation_boxes import Pairs
from .relation_draws import draw

MOSTLY = 0.5  # of a volume or a height: the larger part


def is_under(pairs: Pairs) -> np.ndarray:
    """One has its centre within the other's footprint, and the first's centre is below the second's bottom; where the
    second stands on legs, the whole of the first is below its top. It need not touch, nor be the first thing below."""
    from .relation_kernels import under_shares  # brings numba

    solid, hollow = under_shares(draw(pairs))
    legs = pairs.boxes.on_legs[pairs.second]
    return pairs.both_exist * ((1.0 - legs) * solid + legs * hollow)


def is_inside(pairs: Pairs) -> np.ndarray:
    """More than `MOSTLY` of the first's volume is in the box of the second, which is the larger one."""
    from .relation_kernels import inside_share  # brings numba

    solid = 1.0 - pairs.boxes.on_legs[pairs.second]
    return pairs.both_exist * solid * inside_share(draw(pairs), MOSTLY)


def is_beside(pairs: Pairs, reach: float | None = None) -> np.ndarray:
    """The boxes stand side by side: neither centre is over the other's footprint, they share more than `MOSTLY` of the
    lower one's height, and the horizontal gap between them is at most `reach` metres. By default that is the geometric
    mean of their widths, so that no third thing of their size fits between; a width is the mean of both extents."""
    from .relation_kernels import beside_share  # brings numba

    return pairs.both_exist * beside_share(draw(pairs), MOSTLY, -1.0 if reach is None else float(reach))


def gaps(pairs: Pairs) -> tuple[np.ndarray, np.ndarray]:
    """(P,) mean horizontal gap between the boxes of every pair and its standard deviation, metres."""
    from .relation_kernels import gap_moments  # brings numba

    return gap_moments(draw(pairs))
