"""PCD files in all three forms, and folders of scans."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from plyfile import PlyData, PlyElement

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # `lidar_street` is there

import lidar_street as world

from thingmap.datasets.errors import InputError
from thingmap.datasets.frame import BrokenFrame
from thingmap.datasets.lidar import CAMERA_AXES
from thingmap.datasets.lidar_sequence import LidarSequence
from thingmap.datasets.open import open_sequence
from thingmap.datasets.pcd import BadPcd, read_pcd
from thingmap.datasets.pcd_folder import find_pcd_folder

FRAMES = 3
BOXES = world.street()
POINTS = np.random.default_rng(0).normal(0.0, 10.0, (500, 3)).astype(np.float32)
HEADER = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 1\nPOINTS 2\n"


def pack(plain: bytes, literals: int = 32) -> bytes:
    """LZF without search: runs of one byte as copies at distance one, all else literal."""
    out, i, pending = bytearray(), 0, bytearray()

    def flush() -> None:
        for start in range(0, len(pending), literals):
            run = pending[start : start + literals]
            out.extend([len(run) - 1, *run])
        pending.clear()

    while i < len(plain):
        run = 1
        while i + run < len(plain) and plain[i + run] == plain[i] and run < 265:
            run += 1
        pending.append(plain[i])
        if run > 3:
            flush()
            copies = run - 1
            out.extend([(copies - 2) << 5, 0] if copies < 9 else [7 << 5, copies - 9, 0])
            i += run
        else:
            i += 1
    flush()
    return bytes(out)


def compressed(header: str, plain: bytes) -> bytes:
    packed = pack(plain)
    return f"{header}DATA binary_compressed\n".encode() + np.array([len(packed), len(plain)], "<u4").tobytes() + packed


@pytest.mark.parametrize("form", ["ascii", "binary", "compressed"])
def test_every_form_that_open3d_writes_is_read(tmp_path: Path, form: str) -> None:
    o3d = pytest.importorskip("open3d")
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(POINTS.astype(float)))
    file = tmp_path / "a.pcd"
    assert o3d.io.write_point_cloud(str(file), cloud, write_ascii=form == "ascii", compressed=form == "compressed")
    assert f"DATA {'binary_compressed' if form == 'compressed' else form}".encode() in file.read_bytes()
    fields = read_pcd(file)
    np.testing.assert_allclose(np.stack([fields[a] for a in "xyz"], axis=1), POINTS, rtol=1e-5, atol=1e-5)


@given(st.binary(max_size=400), st.integers(1, 32))
def test_compressed_points_come_back_byte_by_byte(
    tmp_path_factory: pytest.TempPathFactory, data: bytes, run: int
) -> None:
    file = tmp_path_factory.mktemp("lzf") / "a.pcd"
    header = f"FIELDS b\nSIZE 1\nTYPE U\nPOINTS {len(data)}\n"
    packed = pack(data, run)
    body = np.array([len(packed), len(data)], "<u4").tobytes() + packed
    file.write_bytes(f"{header}DATA binary_compressed\n".encode() + body)
    assert read_pcd(file)["b"].tobytes() == data


def test_fields_of_other_types_with_several_values_and_padding(tmp_path: Path) -> None:
    header = (
        "# a comment\nFIELDS x _ ring _ normal\nSIZE 8 1 2 4 4\nTYPE F U U F F\nCOUNT 1 3 1 1 3\nWIDTH 1\nHEIGHT 2\n"
    )
    dtype = np.dtype([("x", "<f8"), ("p", "u1", 3), ("ring", "<u2"), ("q", "<f4"), ("normal", "<f4", 3)])
    table = np.zeros(2, dtype)
    table["x"], table["ring"], table["normal"], table["p"] = [1.5, -2.5], [7, 65535], [[1, 2, 3], [4, 5, 6]], 9
    (tmp_path / "b.pcd").write_bytes(f"{header}DATA binary\n".encode() + table.tobytes())
    columns = b"".join(np.ascontiguousarray(table[name]).tobytes() for name in dtype.names or ())
    (tmp_path / "c.pcd").write_bytes(compressed(header, columns))
    (tmp_path / "a.pcd").write_text(f"{header}DATA ascii\n1.5 9 9 9 7 0 1 2 3\n-2.5 9 9 9 65535 0 4 5 6\n")
    for name in "abc":
        fields = read_pcd(tmp_path / f"{name}.pcd")
        assert set(fields) == {"x", "ring", "normal"}
        np.testing.assert_array_equal(fields["x"], table["x"])
        np.testing.assert_array_equal(fields["ring"], table["ring"])
        np.testing.assert_array_equal(fields["normal"], table["normal"])


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "the header has no row DATA"),
        (b"ply\nformat ascii 1.0\n", "'ply' in the header, which is no keyword of PCD"),
        (b"FIELDS x y\nSIZE 4\nTYPE F F\nPOINTS 1\nDATA ascii\n", "do not have one entry a field"),
        (b"FIELDS x\nSIZE 3\nTYPE F\nPOINTS 1\nDATA binary\n", "field x has SIZE 3, TYPE F, COUNT 1"),
        (b"FIELDS x\nSIZE 4\nTYPE F\nPOINTS many\nDATA ascii\n", "POINTS is many, not a number of points"),
        (b"FIELDS x\nSIZE 4\nTYPE F\nDATA ascii\n", "WIDTH is missing, not a number of points"),
        (b"FIELDS x\nSIZE 4\nTYPE F\nPOINTS 99999999999\nDATA ascii\n", "99999999999 points of 4 bytes are said"),
        (HEADER.encode() + b"DATA binary\n" + bytes(20), "20 bytes of points, 24 expected"),
        (HEADER.encode() + b"DATA ascii\n1 2 3\n", "3 numbers, 6 expected"),
        (HEADER.encode() + b"DATA ascii\n1 2 3 4 5 six\n", "six"),
        (HEADER.encode() + b"DATA zipped\n", "DATA is 'zipped', not ascii, binary or binary_compressed"),
        (HEADER.encode() + b"DATA binary_compressed\n\x01", "compressed bytes"),
        (compressed(HEADER, bytes(24))[:-1], "compressed bytes for 24, 24 expected"),
        (compressed(HEADER, bytes(20)), "bytes for 20, 24 expected"),
        # a copy from before the beginning, one past the end, and a literal run that is cut off
        (
            HEADER.encode() + b"DATA binary_compressed\n\x02\0\0\0\x18\0\0\0\x20\x05",
            "the compressed points are damaged",
        ),
        (
            HEADER.encode() + b"DATA binary_compressed\n\x05\0\0\0\x18\0\0\0\0a\xe0\xff\0",
            "the compressed points are damaged",
        ),
        (HEADER.encode() + b"DATA binary_compressed\n\x02\0\0\0\x18\0\0\0\x1fa", "the compressed points are damaged"),
    ],
)
def test_what_is_wrong_with_a_pcd_file_is_told(tmp_path: Path, content: bytes, reason: str) -> None:
    (tmp_path / "a.pcd").write_bytes(content)
    with pytest.raises(BadPcd, match=reason):
        read_pcd(tmp_path / "a.pcd")


# -- folders


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with images, calibration, stamps and poses; treat as read-only."""
    return world.write_pcd_folder(tmp_path_factory.mktemp("pcd") / "street", FRAMES, BOXES)


@pytest.fixture
def copy(written: Path, tmp_path: Path) -> Path:
    shutil.copytree(written, tmp_path / "street")
    return tmp_path / "street"


def opened(path: Path) -> LidarSequence:
    sequence = open_sequence(path)
    assert isinstance(sequence, LidarSequence)
    return sequence


def test_a_folder_comes_back_as_it_was_written(written: Path) -> None:
    sequence = opened(written)
    stamps, poses = world.drive(FRAMES)
    assert sequence.name == "street" and sequence.names == ("100.000000", "100.100000", "100.200000")
    np.testing.assert_allclose(sequence.stamps, stamps)
    frame = sequence[1]
    points, times = world.sweep(stamps[1], BOXES, moving=True)
    assert frame.scan is not None and frame.scan.times is not None
    np.testing.assert_array_equal(frame.scan.points, points)
    np.testing.assert_allclose(frame.scan.times, times, atol=1e-6)
    np.testing.assert_allclose(frame.T_world_camera, poses[1] @ np.linalg.inv(world.T_CAMERA_LIDAR), atol=1e-6)
    np.testing.assert_array_equal(frame.color, world.image(frame.T_world_camera, BOXES)[0])
    assert (frame.depth > 0.0).mean() > 0.6


def number(folder: Path) -> None:
    """Names 1, 2, ... 10 for the scans (the last ones copies), without stamps, images and poses."""
    shutil.rmtree(folder / "images")
    (folder / "poses.txt").unlink()
    (folder / "calibration.json").unlink()
    scans = sorted(folder.glob("*.pcd"))
    for i in range(1, 11):
        shutil.copy(scans[(i - 1) % FRAMES], folder / f"{i}.pcd")
    for scan in scans:
        scan.unlink()


def test_a_folder_of_scans_alone_is_in_natural_order_at_10_hz(copy: Path) -> None:
    number(copy)
    sequence = opened(copy)
    assert sequence.names == tuple(str(i) for i in range(1, 11)) and sequence.poses is None
    np.testing.assert_allclose(sequence.stamps, np.arange(10) / 10.0)
    frame = sequence[0]
    assert not frame.has_image and frame.scan is not None
    np.testing.assert_array_equal(frame.scan.T_camera_lidar, CAMERA_AXES)


def test_the_file_of_calibration_is_of_use_without_images(copy: Path) -> None:
    number(copy)
    T = np.eye(4)
    T[:3, 3] = 1.0, 2.0, 3.0
    (copy / "calibration.json").write_text(json.dumps({"T_camera_lidar": T.tolist(), "fps": 20}))
    rows = [world.row_text(pose[:3]) for pose in world.drive(10)[1]]
    (copy / "poses.txt").write_text("\n".join(rows) + "\n")
    sequence = opened(copy)
    np.testing.assert_allclose(sequence.stamps, np.arange(10) / 20.0)
    assert sequence.poses is not None
    np.testing.assert_allclose(sequence.poses, world.drive(10)[1] @ np.linalg.inv(T), atol=1e-9)


def test_rows_of_a_tum_trajectory_belong_to_numbered_scans_in_order(copy: Path) -> None:
    rows = (copy / "poses.txt").read_text().splitlines()
    number(copy)
    (copy / "poses.txt").write_text("\n".join([*rows, *rows, *rows, "0 nan nan nan 0 0 0 0"]) + "\n")
    sequence = opened(copy)
    assert sequence.poses is not None and np.isnan(sequence.poses[9]).any() and sequence[9].T_world_camera is None
    expected = world.drive(FRAMES)[1] @ np.linalg.inv(CAMERA_AXES)
    np.testing.assert_allclose(sequence.poses[:FRAMES], expected, atol=1e-6)


def test_ply_scans_are_read_where_nothing_else_is_there(tmp_path: Path) -> None:
    for i in range(2):
        vertices = np.array([(*p, 7) for p in POINTS], dtype=[("x", "f4"), ("y", "f4"), ("z", "f4"), ("red", "u1")])
        PlyData([PlyElement.describe(vertices, "vertex")]).write(str(tmp_path / f"{i}.ply"))
    frame = opened(tmp_path)[1]
    assert frame.scan is not None and frame.scan.times is None
    np.testing.assert_array_equal(frame.scan.points, POINTS)
    (tmp_path / "map.json").write_text("{}")
    assert find_pcd_folder(tmp_path) == []  # many folders hold a model beside other things
    (tmp_path / "map.json").unlink()
    (tmp_path / "1.ply").write_text("ply\nformat ascii 1.0\nelement vertex 1\n")
    with pytest.raises(BrokenFrame, match=r"unreadable scan \(1.ply: not a PLY file of vertices"):
        opened(tmp_path)[1]


@pytest.mark.parametrize(
    ("field", "kind", "values", "expected"),
    [
        ("t", "<u4", [0, 50_000_000, 99_000_000], [0.0, 0.05, 0.099]),
        ("t", "<f4", [-0.05, 0.0, 0.05], [-0.05, 0.0, 0.05]),
        ("timestamp", "<f8", [1e9 + 0.25, 1e9 + 0.30, 1e9 + 0.35], [0.0, 0.05, 0.1]),
    ],
)
def test_times_of_points_in_every_unit(tmp_path: Path, field: str, kind: str, values: list, expected: list) -> None:
    write_timed(tmp_path / "1.pcd", field, kind, values)
    scan = opened(tmp_path)[0].scan
    assert scan is not None and scan.times is not None
    np.testing.assert_allclose(scan.times, expected, atol=1e-6)


def write_timed(path: Path, field: str, kind: str, values: list) -> None:
    table = np.zeros(len(values), dtype=[("xyz", "<f4", 3), ("time", kind)])
    table["xyz"], table["time"] = 1.0, values
    size, letter = kind[2], {"u": "U", "f": "F"}[kind[1]]
    header = f"FIELDS x y z {field}\nSIZE 4 4 4 {size}\nTYPE F F F {letter}\nPOINTS {len(values)}\nDATA binary\n"
    path.write_bytes(header.encode() + table.tobytes())


@pytest.mark.parametrize(
    ("values", "reason"),
    [([0.0, 3.0, 7.0], "field t spans 7 s; a sweep takes at most 1 s"), ([0.0, np.nan, 0.1], "what is no time")],
)
def test_times_that_are_none_break_the_frame(tmp_path: Path, values: list, reason: str) -> None:
    write_timed(tmp_path / "1.pcd", "t", "<f4", [0.0, 0.1, 0.2])
    write_timed(tmp_path / "2.pcd", "t", "<f4", values)
    with pytest.raises(BrokenFrame, match=f"2: unreadable scan .*{reason}"):
        opened(tmp_path)[1]


def test_scans_without_a_coordinate_or_an_image_are_broken_frames(copy: Path) -> None:
    (copy / "images" / "100.100000.png").unlink()
    (copy / "100.200000.pcd").write_text("FIELDS x y\nSIZE 4 4\nTYPE F F\nPOINTS 1\nDATA ascii\n1 2\n")
    sequence = opened(copy)
    with pytest.raises(BrokenFrame, match=r"unreadable image \(100.100000.png is missing\)"):
        sequence[1]
    with pytest.raises(BrokenFrame, match=r"unreadable scan \(100.200000.pcd: no field z\)"):
        sequence[2]


def _calibration(**changes: object):
    def damage(folder: Path) -> None:
        file = folder / "calibration.json"
        values = {**json.loads(file.read_text()), **changes}
        file.write_text(json.dumps({key: value for key, value in values.items() if value is not None}))

    return damage


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (
            lambda f: (f / "calibration.json").unlink(),
            r"T_camera_lidar of the camera, found no such file; write it like",
        ),
        (lambda f: (f / "calibration.json").write_text("{"), r"expected JSON, found .* in line 1"),
        (lambda f: (f / "calibration.json").write_text("[1]"), r"expected a JSON object, found list"),
        (_calibration(fx=None, T_camera_lidar=None), r"found no fx, T_camera_lidar"),
        (_calibration(k1=0.1), r"found also k1"),
        (_calibration(fx="wide"), r"positive width, height"),
        (_calibration(cx=-4), r"principal point inside the image"),
        (_calibration(T_camera_lidar=[[1, 0], [0, 1]]), r"a 4x4 rigid transform in T_camera_lidar"),
        (_calibration(T_camera_lidar=(2 * np.eye(4)).tolist()), r"the last row of the pose is"),
        (_calibration(fps=0), r"a positive fps, found 0"),
        (_calibration(splat=[1]), r"splat as two numbers of pixels, found \[1\]"),
        (_calibration(splat=[1, 500]), r"splat between 0 and 40 pixels, found 1, 500"),
        (lambda f: shutil.copy(f / "images/100.100000.png", f / "images/100.100000.jpg"), r"one file for each name"),
        (lambda f: (f / "poses.txt").write_text("5 0 0 0 0 0 0 1\n"), r"poses within 0.02 s of the frames"),
        (lambda f: (f / "poses.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n"), r"3 rows, one a scan, found 1 rows"),
    ],
)
def test_what_is_wrong_with_a_folder_is_told(copy: Path, damage, message: str) -> None:
    damage(copy)
    with pytest.raises(InputError, match=message):
        opened(copy)
