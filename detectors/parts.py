"""Boxes of a whole object and of its halves, from one to the other.

A template of a part looks at one half of the object's box (Meger et al., Explicit Occlusion, sections 2.3 and 4.1):
the upper or lower, left or right one in the image. So the box of a half says where three sides of the object are, and
implies the fourth.
"""

from __future__ import annotations

import numpy as np

from .detections import Part

_HALF = np.tile(np.eye(4), (len(Part), 1, 1))  # of each part, the matrix from a whole box to the half's
_WHOLE = np.tile(np.eye(4), (len(Part), 1, 1))  # and from the half's box to the whole one
# By part: which side of the box is moved to the middle, and the side opposite to it.
for _part, _moved, _opposite in ((Part.TOP, 3, 1), (Part.BOTTOM, 1, 3), (Part.LEFT, 2, 0), (Part.RIGHT, 0, 2)):
    _HALF[_part, _moved, [_moved, _opposite]] = 0.5, 0.5
    _WHOLE[_part, _moved, [_moved, _opposite]] = 2.0, -1.0


def part_box(xyxy: np.ndarray, part: np.ndarray | int) -> np.ndarray:
    """The half of a whole object's box that a template covers.

    Args:
        xyxy: (N, 4) boxes of whole objects, or (4,) for one; any unit, pixels counted in any way.
        part: (N,) `Part` values, or one. `Part.WHOLE` covers all of the box.

    Returns:
        As `xyxy`.
    """
    return _times(_HALF, xyxy, part)


def whole_box(xyxy: np.ndarray, part: np.ndarray | int) -> np.ndarray:
    """The box of the whole object that a template's box implies: the inverse of `part_box`.

    A LEFT box (x0, y0, x1, y1) reaches as far again to the right: (x0, y0, 2 x1 - x0, y1). A box that the image
    border has cut implies too small an object; one cut to nothing stays nothing.

    Args:
        xyxy: (N, 4) boxes as the templates gave them, or (4,) for one.
        part: (N,) `Part` values, or one.

    Returns:
        As `xyxy`; it may reach out of the image.
    """
    return _times(_WHOLE, xyxy, part)


def _times(matrices: np.ndarray, xyxy: np.ndarray, part: np.ndarray | int) -> np.ndarray:
    return (matrices[part] @ np.asarray(xyxy, dtype=np.float64)[..., None])[..., 0]
