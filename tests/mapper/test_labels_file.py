"""labels.ply there and back; what other programs write into it is tested with the evaluator's inputs."""

from __future__ import annotations

import numpy as np
import pytest

from thingmap.datasets.errors import InputError
from thingmap.datasets.truth import NO_OBJECT
from thingmap.mapper.map.labels_file import PointLabels, read_instances, read_labels, write_labels

CLASSES = ("cup", "Bowl")
POINTS = np.array([[0.0, 0.0, 1.0], [0.1, 0.0, 1.0], [0.2, 0.0, 1.0]])
COLORS = np.zeros((3, 3), np.uint8)
LABEL, SECOND = np.array([1, NO_OBJECT, 0]), np.array([NO_OBJECT, 0, 1])
MARGIN = np.array([2.5, -0.25, 0.5], np.float32)


def test_labels_come_back_with_their_doubts(tmp_path):
    file = tmp_path / "labels.ply"
    labels = PointLabels(LABEL, SECOND, MARGIN, np.array([0, 1, 1]))
    write_labels(file, POINTS, COLORS, labels, CLASSES, ["thing-0007"])
    points, labels = read_labels(file, ("bowl", "cup"))  # names count, not their order
    np.testing.assert_allclose(points, POINTS, atol=1e-6)
    assert labels.second is not None and labels.margin is not None
    assert labels.label.tolist() == [0, NO_OBJECT, 1] and labels.second.tolist() == [NO_OBJECT, 1, 0]
    assert labels.margin.tolist() == MARGIN.tolist()
    assert labels.instance is not None and labels.instance.tolist() == [0, 1, 1]
    assert read_instances(file)["thing-0007"].shape == (2, 3)


def test_a_file_without_doubts_has_none(tmp_path):
    file = tmp_path / "labels.ply"
    write_labels(file, POINTS, COLORS, PointLabels(LABEL), CLASSES)
    _, labels = read_labels(file, CLASSES)
    assert labels.label.tolist() == LABEL.tolist() and labels.second is None and labels.margin is None
    assert labels.instance is None
    with pytest.raises(InputError, match="instance"):
        read_instances(file)


@pytest.mark.parametrize("wrong", [(LABEL, SECOND, None), (LABEL, None, MARGIN), (LABEL, SECOND, MARGIN[:2])])
def test_doubts_are_of_the_same_points(wrong):
    with pytest.raises(ValueError, match="equal lengths"):
        PointLabels(*wrong)
