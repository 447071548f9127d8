"""Submaps that grow one after the other in the same memory."""

import numpy as np
import pytest
from voxel_frames import random_frame

from thingmap.mapper.labelling.submap import FrozenSubmap, Submap

SIZE = 0.01


def grown(submap: Submap, seeds: range, points: int) -> FrozenSubmap:
    for number, seed in enumerate(seeds, 1):
        f = random_frame(np.random.default_rng(seed), submap.classes, points, submap.anchor)
        submap.keyframes[f.keyframe] = np.eye(4)
        submap.add(number, f.T_keyframe_camera, f.arguments()[2:], 1000)
    return submap.freeze()


@pytest.mark.parametrize("classes", [6, 20])  # of which 8 are kept
@pytest.mark.parametrize("points", [50, 500])  # of 200 that were there before
def test_a_submap_is_the_same_in_the_memory_of_another(classes: int, points: int) -> None:
    submap = Submap(0, classes, 8, SIZE)
    before = grown(submap, range(3), 200)
    cells = before.cells.copy()
    submap.begin_again(7)
    again, alone = grown(submap, range(3, 6), points), grown(Submap(7, classes, 8, SIZE), range(3, 6), points)
    assert again.anchor == 7 and again.keyframes.tolist() == [7]
    for name in ("cells", "counts", "sums", "class_sums"):
        np.testing.assert_array_equal(getattr(again, name), getattr(alone, name))
    assert (again.kept is None) == (classes == 6)
    for name in ("taken", "ids", "values") if again.kept is not None else ():
        np.testing.assert_array_equal(getattr(again.kept, name), getattr(alone.kept, name))
    np.testing.assert_array_equal(before.cells, cells)  # what was finished stays
