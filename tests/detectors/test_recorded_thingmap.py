"""Our own format: whatever is written comes back to the bit."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thingmap.datasets.errors import InputError
from thingmap.detectors.detections import Detections
from thingmap.detectors.recorded import RecordedDetections, write_detections

WIDTH, HEIGHT = 64, 48
CLASSES = ("cup", "Stuhl", "été")

inside = st.floats(0, 1, allow_subnormal=True)


@st.composite
def detections(draw) -> Detections:
    """Boxes of some area inside the image, with every kind of array there may be."""
    n, k = draw(st.integers(0, 4)), len(CLASSES)
    start = draw(arrays(np.float64, (n, 2), elements=st.floats(0, 0.5)))
    extent = draw(arrays(np.float64, (n, 2), elements=st.floats(1e-9, 0.5)))
    xyxy = np.concatenate([start, start + extent], axis=1) * [WIDTH, HEIGHT, WIDTH, HEIGHT]
    scores = draw(arrays(np.float64, (n, k), elements=inside))
    known = draw(arrays(bool, (n, k)))
    known[~known.any(axis=1), draw(st.integers(0, k - 1))] = True
    part = draw(arrays(np.int8, n, elements=st.integers(0, 4)))
    mask = draw(st.none() | arrays(bool, (n, HEIGHT, WIDTH), elements=st.booleans(), fill=st.booleans()))
    d = draw(st.integers(0, 3))
    values = st.floats(width=32, allow_nan=False, allow_infinity=False)
    embedding = draw(st.none() | arrays(np.float32, (n, d), elements=values))
    return Detections(CLASSES, xyxy, np.where(known, scores, np.nan), part, mask, embedding)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(detections(), max_size=3))
def test_round_trip(tmp_path: Path, make_frame, assert_same, written: list[Detections]):
    path = tmp_path / "found.json"
    names = [f"frame-{i:06}" for i in range(len(written))]
    assert write_detections(path, CLASSES, zip(names, written, strict=True), overwrite=True) == len(written)
    recorded = RecordedDetections(path)
    assert recorded.classes == CLASSES
    for name, found in zip(names, written, strict=True):
        assert_same(recorded(make_frame(name)), found)
    assert recorded.missing == () and recorded.dropped == 0


def one(score: float = 0.5) -> Detections:
    return Detections(("cup",), np.array([[0.0, 0.0, 8.0, 8.0]]), np.array([[score]]))


def test_an_existing_file_stays_unless_told(tmp_path: Path):
    path = tmp_path / "found.json"
    path.write_text("precious")
    with pytest.raises(InputError, match="expected a new file, found an existing one"):
        write_detections(path, ("cup",), [("a", one())])
    assert path.read_text() == "precious"
    assert write_detections(path, ("cup",), [("a", one())], overwrite=True) == 1
    assert json.loads(path.read_text())["classes"] == ["cup"]


def test_nothing_is_left_of_a_run_that_breaks(tmp_path: Path):
    def breaking():
        yield "a", one()
        raise KeyboardInterrupt

    path = tmp_path / "found.json"
    path.write_text("precious")
    with pytest.raises(KeyboardInterrupt):
        write_detections(path, ("cup",), breaking(), overwrite=True)
    assert path.read_text() == "precious" and [p.name for p in tmp_path.iterdir()] == ["found.json"]


def test_frames_are_written_as_they_come(tmp_path: Path):
    seen = []

    def watching():
        for i in range(2000):
            yield f"{i}", one(i / 2000)
            seen.append(sum(p.stat().st_size for p in tmp_path.glob("*.part")))

    write_detections(tmp_path / "found.json", ("cup",), watching())
    assert seen[-1] > seen[0] and seen[1000] > 0


def test_what_cannot_be_written(tmp_path: Path):
    path = tmp_path / "found.json"
    with pytest.raises(ValueError, match=r"'a.color' comes twice"):
        write_detections(path, ("cup",), [("a", one()), ("a.color", one())])
    with pytest.raises(ValueError, match="other classes"):
        write_detections(path, ("cup", "dog"), [("a", one())])
    with pytest.raises(InputError, match="a folder to write into"):
        write_detections(tmp_path / "no" / "found.json", ("cup",), [])
    assert not list(tmp_path.iterdir())


RIGHT = {"name": "a", "xyxy": [[0, 0, 1, 1]], "scores": [[0.5, 0.25]]}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"xyxy": [[0, 0, 1]]}, r"frame 1: xyxy must have shape \(N, 4\)"),
        ({"xyxy": [[0, 0, 1, 1], [0]]}, "frame 1: "),
        ({"xyxy": []}, r"frame 1: scores must have shape \(0, 2\), but got shape \(1, 2\)"),
        ({"scores": [[0.5]]}, r"frame 1: scores must have shape \(1, 2\)"),
        ({"scores": [{"2": 0.5}]}, "class number 2 of 2 classes"),
        ({"scores": [{"cup": 0.5}]}, "invalid literal"),
        ({"scores": [[0.5, 2]]}, "but got 2"),
        ({"scores": [[None, None]]}, "a row without any"),
        ({"scores": None}, "frame 1"),
        ({"part": [9]}, "values of Part"),
        ({"part": [0, 0]}, r"part must have shape \(1,\)"),
        ({"name": "0.color"}, "two frames named '0'"),
        ({"name": 3}, "frame 1"),
        ({"embedding": {"size": 2, "values": [[1]]}}, "embedding"),
        ({"mask": {"size": [2, 2], "counts": [[3]]}}, "add up to 2 x 2"),
        ({"mask": {"size": [2, 2], "counts": []}}, "0 masks for 1 boxes"),
        ({"mask": {"counts": []}}, "frame 1: no 'size'"),
    ],
)
def test_wrong_files(tmp_path: Path, change: dict, message: str):
    path = tmp_path / "found.json"
    frames = [RIGHT | {"name": "0"}, RIGHT | change]
    path.write_text(json.dumps({"format": "thingmap-detections/1", "classes": ["a", "b"], "frames": frames}))
    with pytest.raises(InputError, match=message) as error:
        RecordedDetections(path)
    assert error.value.path == path


def test_written_by_hand(tmp_path: Path, make_frame):
    path = tmp_path / "found.json"
    frame = {"name": "rgb/a.png", "xyxy": [[0, 0, 1, 1]] * 2, "scores": [[0.5, None], {"1": 0.25}]}
    path.write_text(json.dumps({"format": "thingmap-detections/1", "classes": ["a", "b"], "frames": [frame]}))
    found = RecordedDetections(path)(make_frame("a"))
    np.testing.assert_array_equal(found.scores, [[0.5, np.nan], [np.nan, 0.25]])
    assert found.part.tolist() == [0, 0]


def test_a_later_version_is_not_guessed_at(tmp_path: Path):
    path = tmp_path / "found.json"
    path.write_text('{"format": "thingmap-detections/2", "classes": [], "frames": []}')
    with pytest.raises(InputError, match="format 'thingmap-detections/2'"):
        RecordedDetections(path)


def test_masks_of_another_image_size(tmp_path: Path, make_frame):
    path = tmp_path / "found.json"
    found = Detections(("cup",), one().xyxy, one().scores, mask=np.ones((1, HEIGHT, WIDTH), dtype=bool))
    write_detections(path, ("cup",), [("a", found)])
    with pytest.raises(InputError, match=r"images of 32x24 \(a\), found 64x48"):
        RecordedDetections(path)(make_frame("a", size=(32, 24)))
