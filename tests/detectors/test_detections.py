"""What `Detections` accept, and taking them apart and together."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from thingmap.detectors.detections import Detections, Part

NAN = float("nan")


def three() -> Detections:
    return Detections(
        ("cup", "chair"),
        [[0, 0, 10, 20], [5, 5, 15, 8], [30, 1, 40, 2]],  # type: ignore[arg-type]
        [[0.9, NAN], [0.2, 0.3], [NAN, 0.0]],  # type: ignore[arg-type]
        part=np.array([0, 1, 4]),
        mask=np.arange(3 * 4).reshape(3, 2, 2) % 3 == 0,
        embedding=np.arange(6).reshape(3, 2),
    )


def test_best_class_looks_past_unknown_scores():
    found = three()
    assert found.class_id.tolist() == [0, 1, 1]
    assert found.confidence.tolist() == [0.9, 0.3, 0.0]


def test_types_are_the_documented_ones():
    found = three()
    assert found.xyxy.dtype == np.float64 and found.scores.dtype == np.float64
    assert found.part.dtype == np.int8 and found.embedding is not None and found.embedding.dtype == np.float32


def test_no_detections():
    for classes in ((), ("cup",)):
        found = Detections.empty(classes)
        assert len(found) == 0 and found.class_id.shape == (0,) and found.confidence.shape == (0,)
        assert found.xyxy.shape == (0, 4) and found.scores.shape == (0, len(classes))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"classes": ("cup", "cup")}, "'cup' twice"),
        ({"classes": "ab"}, "classes must be a tuple of names"),
        ({"xyxy": np.zeros((2, 3))}, r"xyxy must have shape \(N, 4\), but got shape \(2, 3\)"),
        ({"xyxy": np.zeros(4)}, r"xyxy must have shape"),
        ({"xyxy": np.array([[0, 0, 1, 1], [5, 0, 4, 1]])}, r"x1 <= x2 .* got \[5.0, 0.0, 4.0, 1.0\]"),
        ({"xyxy": np.array([[0, 0, 1, 1], [0, 0, NAN, 1]])}, "finite"),
        ({"scores": np.zeros((2, 3))}, r"scores must have shape \(2, 2\), but got shape \(2, 3\)"),
        ({"scores": np.array([[0.5, 1.5], [0, 0]])}, r"in \[0, 1\] or NaN, but got 1.5"),
        ({"scores": np.array([[0.5, -0.1], [0, 0]])}, "but got -0.1"),
        ({"scores": np.array([[NAN, NAN], [0, 0]])}, "a row without any"),
        ({"part": np.zeros(3)}, r"part must have shape \(2,\)"),
        ({"part": np.array([0, 5])}, r"values of Part, but got \[0, 5\]"),
        ({"mask": np.zeros((2, 4, 4))}, "mask must be bool .* got float64"),
        ({"mask": np.zeros((1, 4, 4), bool)}, r"mask must be bool of shape \(2, H, W\)"),
        ({"embedding": np.zeros((3, 4))}, r"embedding must be finite of shape \(2, D\)"),
    ],
)
def test_wrong_values_are_named(change: dict, message: str):
    right = {"classes": ("a", "b"), "xyxy": np.array([[0, 0, 1, 1], [0, 0, 2, 2]]), "scores": np.full((2, 2), 0.5)}
    Detections(**right)
    with pytest.raises(ValueError, match=message):
        Detections(**(right | change))


@pytest.mark.parametrize(
    ("index", "rows"),
    [
        ([2, 0], [2, 0]),
        (np.array([True, False, True]), [0, 2]),
        (slice(1, None), [1, 2]),
        ([], []),
        (np.zeros(3, dtype=bool), []),
    ],
)
def test_select_takes_every_array(index, rows: list[int]):
    found, chosen = three(), three().select(index)
    assert len(chosen) == len(rows)
    rows = np.array(rows, dtype=int)  # type: ignore[assignment]
    for name in ("xyxy", "scores", "part", "mask", "embedding"):
        np.testing.assert_array_equal(getattr(chosen, name), getattr(found, name)[rows])


def test_clip_cuts_boxes_and_leaves_out_those_outside():
    found = Detections(
        ("a",), np.array([[-5, 2, 3, 99], [64, 0, 70, 5], [1, 1, 2, 2]]), np.array([[0.1], [0.2], [0.3]])
    )
    inside = found.clip(64, 48)
    assert inside.xyxy.tolist() == [[0, 2, 3, 48], [1, 1, 2, 2]]
    assert inside.confidence.tolist() == [0.1, 0.3]


def test_concatenate(assert_same):
    found = three()
    assert_same(Detections.concatenate([found.select([0]), found.select([]), found.select([1, 2])]), found)
    assert_same(Detections.concatenate([Detections.empty(found.classes), found]), found)
    with pytest.raises(ValueError, match="mask in all or in none"):
        Detections.concatenate([found, Detections(found.classes, found.xyxy, found.scores)])
    with pytest.raises(ValueError, match="equal classes"):
        Detections.concatenate([found, Detections.empty(("cup",))])
    with pytest.raises(ValueError, match="at least one"):
        Detections.concatenate([])


def test_best_class_alone_leaves_the_others_unknown():
    found = Detections.from_best_class(("a", "b", "c"), [[0, 0, 1, 1], [0, 0, 2, 2]], [2.0, 0], [0.5, 0.25])
    np.testing.assert_array_equal(found.scores, [[NAN, NAN, 0.5], [0.25, NAN, NAN]])
    assert found.part.tolist() == [Part.WHOLE, Part.WHOLE]
    assert len(Detections.from_best_class(("a",), [], [], [])) == 0
    for wrong in (3, -1, 0.5):
        with pytest.raises(ValueError, match=r"class_id must be one of 0..2"):
            Detections.from_best_class(("a", "b", "c"), [[0, 0, 1, 1]], [wrong], [0.5])


def test_importing_the_package_loads_nothing_heavy():
    code = (
        "import sys, thingmap.datasets; before = set(sys.modules)\n"
        "import thingmap.detectors.spec; print(*set(sys.modules) - before)"
    )
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert "thingmap.detectors.detections" in loaded
    assert not {"cv2", "yaml", "onnxruntime", "gtsam", "open3d", "scipy", "numba"} & set(loaded)
