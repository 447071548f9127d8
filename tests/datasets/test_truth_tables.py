from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thingmap.datasets.errors import InputError, UserError
from thingmap.datasets.truth import NO_OBJECT, FrameTruth, PointTruth
from thingmap.datasets.truth_tables import (
    encode_instances,
    read_cloud,
    read_frames,
    read_instances,
    write_cloud,
    write_frames,
)

FIELDS = ("object_id", "xyxy", "xyxy_visible", "visibility", "part_visibility")
IDS = {0, 1, 2, 3, 4}


def sightings(count: int, seed: int) -> FrameTruth:
    """Truth of a frame in which `count` objects are seen, the first without a visible pixel."""
    rng = np.random.default_rng(seed)
    boxes, visible = rng.uniform(-50, 700, (2, count, 4))
    visible[:1] = np.nan
    ids = rng.choice(5, count, replace=False)
    return FrameTruth(ids, boxes, visible, rng.random(count), rng.random((count, 5)))


@given(counts=st.lists(st.integers(0, 5), min_size=1, max_size=8))
def test_every_frame_comes_back_exactly(tmp_path_factory, counts: list[int]) -> None:
    path = tmp_path_factory.mktemp("truth") / "frames.npz"
    frames = [sightings(count, seed) for seed, count in enumerate(counts)]
    stamps = 0.1 * np.arange(len(counts)) + 1e9
    write_frames(path, stamps, frames)
    table = read_frames(path, len(counts), IDS)
    np.testing.assert_array_equal(table.stamps, stamps)
    for index, frame in enumerate(frames):
        back = table.frame(index)
        for name in FIELDS:
            np.testing.assert_array_equal(getattr(back, name), getattr(frame, name))
    back = table.frame(0)
    back.xyxy[:] = 0.0  # what a caller does with it stays with the caller
    np.testing.assert_array_equal(table.frame(0).xyxy, frames[0].xyxy)


@pytest.fixture
def frames_file(tmp_path: Path) -> Path:
    write_frames(tmp_path / "frames.npz", np.arange(3.0), [sightings(n, n) for n in (2, 0, 3)])
    return tmp_path / "frames.npz"


def rewrite(path: Path, **changes) -> None:
    """Replaces arrays of the file; None removes one."""
    with np.load(path) as content:
        arrays = {name: content[name] for name in content.files} | changes
    np.savez(path, **{name: array for name, array in arrays.items() if array is not None})


@pytest.mark.parametrize(
    ("changes", "parts"),
    [
        ({"stamps": None}, ["arrays stamps", "no stamps"]),
        ({"xyxy": None, "visibility": None}, ["no xyxy, visibility"]),
        ({"stamps": np.arange(2.0)}, ["3 frames", "2 stamps"]),
        ({"stamps": np.array([0.0, 2.0, 1.0])}, ["rising stamps"]),
        ({"stamps": np.array([0.0, 1.0, np.nan])}, ["rising stamps"]),
        ({"stamps": np.float64(1.0)}, ["3 frames", "no stamps"]),
        ({"frame": np.array([0, 0, 2, 2, 3])}, ["from 0 to 2", "0 to 3"]),
        ({"frame": np.array([2, 2, 0, 0, 0])}, ["rising frame numbers"]),
        ({"frame": np.arange(4) * 0}, ["of shape (4,)"]),
        ({"object_id": np.array([0, 1, 2, 3, 77])}, ["ids of truth.json's objects", "id 77"]),
        ({"object_id": np.zeros(5)}, ["object_id", "float64"]),
        ({"xyxy": np.zeros((5, 3))}, ["xyxy of shape (5, 4)", "(5, 3)"]),
        ({"xyxy": np.full((5, 4), np.inf)}, ["finite boxes"]),
        ({"visibility": np.full(5, 1.5)}, ["from 0 to 1"]),
        ({"part_visibility": np.full((5, 5), np.nan)}, ["from 0 to 1"]),
    ],
)
def test_wrong_arrays_are_told(frames_file: Path, changes: dict, parts: list[str]) -> None:
    rewrite(frames_file, **changes)
    with pytest.raises(InputError) as error:
        read_frames(frames_file, 3, IDS)
    for part in (str(frames_file), "thingmap synth", *parts):
        assert part in str(error.value)


def test_a_file_that_is_cut_anywhere_is_told(frames_file: Path) -> None:
    content = frames_file.read_bytes()
    for length in range(0, len(content), 97):
        frames_file.write_bytes(content[:length])
        with pytest.raises(InputError, match=r"frames\.npz"):
            read_frames(frames_file, 3, IDS)
    frames_file.unlink()
    with pytest.raises(InputError, match="no such file"):
        read_frames(frames_file, 3, IDS)


def test_flipped_bytes_are_told_or_do_no_harm(frames_file: Path) -> None:
    content = frames_file.read_bytes()
    good = read_frames(frames_file, 3, IDS)
    told = 0
    for place in range(0, len(content), 41):
        frames_file.write_bytes(content[:place] + bytes([content[place] ^ 0xFF]) + content[place + 1 :])
        try:
            table = read_frames(frames_file, 3, IDS)
        except InputError:
            told += 1
        else:
            np.testing.assert_array_equal(table.rows.xyxy, good.rows.xyxy)
    assert told > 5


def test_an_array_that_is_no_archive_is_told(tmp_path: Path) -> None:
    np.save(tmp_path / "frames.npy", np.zeros(3))
    with pytest.raises(InputError, match="one array"):
        read_frames((tmp_path / "frames.npy").rename(tmp_path / "frames.npz"), 3, IDS)


@given(ids=st.lists(st.sampled_from([NO_OBJECT, 0, 3, 4000, 65534]), min_size=12, max_size=12))
def test_instances_come_back(tmp_path_factory, ids: list[int]) -> None:
    path = tmp_path_factory.mktemp("truth") / "000000.png"
    image = np.array(ids, dtype=np.int32).reshape(3, 4)
    path.write_bytes(encode_instances(image))
    back = read_instances(path, (3, 4), {0, 3, 4000, 65534})
    assert back.dtype == np.int32
    np.testing.assert_array_equal(back, image)


def test_wrong_instance_images_are_told(tmp_path: Path) -> None:
    path = tmp_path / "000000.png"
    with pytest.raises(InputError, match="no such file"):
        read_instances(path, (3, 4), {0})
    path.write_bytes(b"")
    with pytest.raises(InputError, match="an empty file"):
        read_instances(path, (3, 4), {0})
    path.write_bytes(b"no image")
    with pytest.raises(InputError, match="cannot be decoded"):
        read_instances(path, (3, 4), {0})
    path.write_bytes(encode_instances(np.zeros((3, 5), np.int32)))
    with pytest.raises(InputError, match=r"16-bit PNG of 4 x 3 pixels, found 5 x 3 of uint16"):
        read_instances(path, (3, 4), {0})
    cv2.imwrite(str(path), np.zeros((3, 4, 3), np.uint8))
    with pytest.raises(InputError, match="4 x 3 x 3 of uint8"):
        read_instances(path, (3, 4), {0})
    path.write_bytes(encode_instances(np.full((3, 4), 5, np.int32)))
    with pytest.raises(InputError, match="found id 5"):
        read_instances(path, (3, 4), {0, 1})
    with pytest.raises(UserError, match="65535"):
        encode_instances(np.full((3, 4), 65535, np.int32))


@pytest.mark.parametrize("with_objects", [True, False])
def test_a_cloud_comes_back(tmp_path: Path, with_objects: bool) -> None:
    rng = np.random.default_rng(0)
    points, classes = rng.normal(size=(50, 3)).astype(np.float32), rng.integers(-1, 3, 50)
    objects = rng.integers(-1, 5, 50) if with_objects else None
    write_cloud(tmp_path / "cloud.ply", PointTruth(points, classes, objects))
    back = read_cloud(tmp_path / "cloud.ply", 3, IDS)
    np.testing.assert_array_equal(back.points, points)
    np.testing.assert_array_equal(back.class_id, classes)
    assert (back.points.dtype, back.class_id.dtype) == (np.float32, np.int64)
    if objects is None:
        assert back.object_id is None
    else:
        np.testing.assert_array_equal(back.object_id, objects)


def test_wrong_clouds_are_told(tmp_path: Path) -> None:
    path = tmp_path / "cloud.ply"
    with pytest.raises(InputError, match="no such file"):
        read_cloud(path, 3, IDS)
    points = np.zeros((4, 3), np.float32)
    write_cloud(path, PointTruth(points, np.array([0, 1, 2, -1]), np.array([0, 1, 9, -1])))
    with pytest.raises(InputError, match="class_id from -1 to 1, found -1 to 2"):
        read_cloud(path, 2, IDS)
    with pytest.raises(InputError, match="found id 9"):
        read_cloud(path, 3, IDS)
    content = path.read_bytes()
    for damaged in (b"", b"ply\n", content[:-3], content.replace(b"class_id", b"klass_id")):
        path.write_bytes(damaged)
        with pytest.raises(InputError, match=r"cloud\.ply"):
            read_cloud(path, 3, IDS | {9})
    write_cloud(path, PointTruth(np.full((1, 3), np.nan, np.float32), np.array([0]), None))
    with pytest.raises(InputError, match="finite points"):
        read_cloud(path, 3, IDS)
