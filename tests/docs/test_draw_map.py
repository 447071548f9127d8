"""The script that draws a map: where things land in the picture, and what it says when it cannot draw."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thingmap.datasets.errors import InputError
from thingmap.mapper.map.object_map import MapFrame, ObjectMap, UpDirection
from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.map.thing import Evidence, Thing

SCRIPT = Path(__file__).resolve().parents[2] / "docs" / "draw_map.py"
CUP, BOWL = np.array([-0.2, 0.1, 1.0]), np.array([0.25, 0.05, 1.3])
WIDTH = 400


def _load() -> ModuleType:
    spec = importlib.util.spec_from_file_location("draw_map", SCRIPT)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["draw_map"] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


draw_map = _load()


def _thing(number: int, label: str, position: np.ndarray, **changes: Any) -> Thing:
    covariance = 1e-4 * np.array([[4.0, 1.0, 0.0], [1.0, 2.0, 0.5], [0.0, 0.5, 9.0]])
    values: dict[str, Any] = {
        "id": f"thing-{number:04d}",
        "label": label,
        "probability": 0.999,
        "existence": 1.0,
        "class_posterior": {label: 0.999},
        "position": position,
        "position_covariance": covariance,
        "size": [0.2, 0.15, 0.1],
        "size_std": [0.01, 0.01, 0.01],
        "yaw": 0.3,
        "first_seen": 0.0,
        "last_seen": 1.0,
        "evidence": Evidence(5, 0, 0),
    }
    return Thing(**{**values, **changes})


def _table() -> np.ndarray:
    """(M, 3) points 2 cm apart on a plane 10 cm under the things; in the first camera's axes y is down."""
    x, z = np.meshgrid(np.arange(-0.6, 0.6, 0.02), np.arange(0.6, 1.8, 0.02))
    return np.stack([x.ravel(), np.full(x.size, 0.25), z.ravel()], axis=1)


def _poses() -> np.ndarray:
    poses = np.tile(np.eye(4), (8, 1, 1))
    poses[:, 0, 3] = np.linspace(-0.1, 0.1, 8)
    return poses


@pytest.fixture
def write_out(tmp_path: Path) -> Callable[..., Path]:
    """`write_out(*things)` writes the folder of a run."""

    def write(*things: Thing) -> Path:
        folder = OutputFolder.create(tmp_path / "out")
        up = UpDirection(np.array([0.0, -1.0, 0.0]), 0.01, "planes")
        folder.write_map(ObjectMap(things, ("cup", "bowl"), "table", MapFrame.FIRST_CAMERA, up), include_doubtful=True)
        folder.write_trajectory(np.arange(8) / 10.0, _poses())
        points = _table()
        folder.write_cloud(points, np.full(points.shape, 120, dtype=np.uint8))
        return folder.path

    return write


@pytest.fixture
def scene(write_out: Callable[..., Path]) -> Any:
    return draw_map.read_scene(write_out(_thing(1, "cup", CUP), _thing(2, "bowl", BOWL)))


def _pixels(view: Any, points: np.ndarray) -> np.ndarray:
    """(N, 2) by the pinhole equations alone."""
    local = np.linalg.inv(view.T_world_view) @ np.column_stack([points, np.ones(len(points))]).T
    k = view.intrinsics
    return np.column_stack([k.fx * local[0] / local[2] + k.cx, k.fy * local[1] / local[2] + k.cy])


def _pen(view: Any, depth: float) -> Any:
    k = view.intrinsics
    black = np.zeros((k.height, k.width, 3), dtype=np.uint8)
    return draw_map.Pen(view, black, np.full((k.height, k.width), depth, dtype=np.float32))


def test_corners_of_the_boxes_have_their_label_s_colour(scene: Any) -> None:
    view = draw_map.choose_view(scene, 800)
    image, _ = draw_map.draw(scene, view)
    assert image.shape == (400, 800, 3) and image.dtype == np.uint8
    for thing in scene.things:
        color = np.array(scene.palette[thing.label])
        for u, v in np.round(_pixels(view, thing.corners(scene.R_world_upright))).astype(int):
            around = image[v - 2 : v + 3, u - 2 : u + 3].reshape(-1, 3).astype(int)
            assert np.abs(around - color).sum(axis=1).min() < 90, (thing.label, u, v)


def test_a_box_covers_just_the_pixels_between_its_projected_corners(scene: Any) -> None:
    view = draw_map.choose_view(scene, 800)
    pen = _pen(view, np.inf)
    corners = scene.things[0].corners(scene.R_world_upright)
    pen.segments(corners[draw_map.EDGES], (255, 255, 255), 1.0)
    v, u = np.nonzero(pen.image[..., 0] > 100)
    expected = _pixels(view, corners)
    assert np.allclose([u.min(), v.min()], expected.min(axis=0), atol=2.0)
    assert np.allclose([u.max(), v.max()], expected.max(axis=0), atol=2.0)


def test_what_the_cloud_hides_is_fainter(scene: Any) -> None:
    view = draw_map.choose_view(scene, 800)
    edges = scene.things[0].corners(scene.R_world_upright)[draw_map.EDGES]
    shown, hidden = _pen(view, np.inf), _pen(view, 0.1)
    for pen in (shown, hidden):
        pen.segments(edges, (255, 255, 255), 2.0)
    assert 0 < hidden.image.max() < 0.6 * shown.image.max()


def test_a_doubtful_thing_is_fainter(scene: Any) -> None:
    cup = scene.things[0]
    doubtful = replace(cup, probability=0.4, class_posterior={"cup": 0.4})
    view = draw_map.choose_view(scene, 800)
    sure, unsure = (draw_map.draw(replace(scene, things=(t,)), view)[0].astype(int) for t in (cup, doubtful))
    color = np.array(draw_map.PALETTE[0])
    u, v = np.round(_pixels(view, cup.corners(scene.R_world_upright)[4:6]).mean(axis=0)).astype(int)
    near = np.s_[v - 2 : v + 3, u - 2 : u + 3]
    distance = [np.abs(image[near] - color).sum(axis=-1).min() for image in (sure, unsure)]
    assert distance[0] < 60 and distance[1] > 2 * distance[0]


def test_the_ellipse_holds_the_mass_of_two_sigmas(scene: Any) -> None:
    view, cup = draw_map.choose_view(scene, WIDTH), scene.things[0]
    samples = np.random.default_rng(0).multivariate_normal(cup.position, cup.position_covariance, 4000)
    outline = view.ellipse(cup).astype(np.float32)[:, None]
    inside = [cv2.pointPolygonTest(outline, (float(u), float(v)), False) >= 0 for u, v in _pixels(view, samples)]
    assert np.mean(inside) == pytest.approx(1.0 - np.exp(-2.0), abs=0.02)


def test_the_view_looks_from_behind_and_above_and_shows_everything(scene: Any) -> None:
    up = np.array([0.0, -1.0, 0.0])
    view = draw_map.choose_view(scene, WIDTH, elevation=30.0)
    forward = view.T_world_view[:3, 2]
    assert np.degrees(np.arcsin(-forward @ up)) == pytest.approx(30.0)
    assert forward[2] == pytest.approx(np.cos(np.radians(30.0)))  # the camera looked along z
    assert view.T_world_view[:3, 1] @ up < 0.0
    for azimuth, elevation in ((0.0, 30.0), (75.0, 10.0), (-160.0, 90.0)):
        view = draw_map.choose_view(scene, WIDTH, azimuth, elevation)
        uv = _pixels(view, scene.extent)
        assert np.all(view.to_view(scene.extent)[:, 2] > 0.0)
        assert np.all(uv > 0.0) and np.all(uv < [WIDTH, WIDTH / 2])
        assert np.ptp(uv, axis=0).max() > 0.4 * WIDTH / 2


def test_azimuth_turns_the_viewer_counterclockwise(scene: Any) -> None:
    eye = draw_map.choose_view(scene, WIDTH, azimuth=90.0).T_world_view[:3, 3]
    assert eye[0] > 0.5  # from behind, which is -z, to the right, which is +x


def test_nearer_points_cover_farther_ones_and_a_tall_wall_in_front_is_left_out(scene: Any) -> None:
    table = scene.points
    x, y = np.meshgrid(np.arange(-0.6, 0.6, 0.02), np.arange(-0.6, 0.25, 0.02))
    wall = np.stack([x.ravel(), y.ravel(), np.full(x.size, 0.4)], axis=1)  # between the viewer and the things
    under = table + np.array([0.0, 0.2, 0.0])
    points = np.concatenate([under, table, wall])
    parts = np.repeat([0, 1, 2], [len(under), len(table), len(wall)])
    colors = np.array([(0, 255, 0), (255, 0, 0), (0, 0, 255)], dtype=np.uint8)[parts]
    scene = replace(scene, points=points, colors=colors)
    view = draw_map.choose_view(scene, WIDTH, elevation=50.0)
    seen = draw_map.in_sight(scene, view, 0.02)
    assert seen[parts == 1].mean() > 0.98 and not seen[(parts == 2) & (points[:, 1] < -0.1)].any()
    image, depth = draw_map.draw_cloud(scene, view)
    u, v = np.round(_pixels(view, np.array([[0.0, 0.25, 1.2]]))[0]).astype(int)
    assert image[v, u, 0] > 150 and image[v, u, 1] < 60 and image[v, u, 2] < 60
    assert depth[v, u] == pytest.approx(view.to_view(np.array([[0.0, 0.25, 1.2]]))[0, 2], abs=0.03)
    assert np.isinf(depth[0, 0])


@given(
    st.lists(st.tuples(st.integers(0, 640), st.integers(0, 320), st.integers(20, 90)), min_size=1, max_size=25),
)
def test_tags_lie_in_the_picture_and_never_overlap(tags: list[tuple[int, int, int]]) -> None:
    anchors = np.array([(u, v) for u, v, _ in tags], dtype=float)
    sizes = np.array([(width, 14) for _, _, width in tags], dtype=float)
    boxes = np.concatenate([anchors - 10, anchors + 10], axis=1)
    places = draw_map.place_tags(anchors, sizes, boxes, (640, 320))
    found = places[np.isfinite(places[:, 0])]
    assert len(found) >= min(len(tags), 8)
    assert np.all(found[:, :2] >= 0.0) and np.all(found[:, 2:] <= [640, 320])
    for i, (x0, y0, x1, y1) in enumerate(found):
        for a0, b0, a1, b1 in found[:i]:
            assert x1 <= a0 or a1 <= x0 or y1 <= b0 or b1 <= y0


def test_a_tag_keeps_its_size_and_rather_covers_nothing() -> None:
    anchor, size = np.array([[320.0, 160.0]]), np.array([[80.0, 16.0]])
    box = np.array([[280.0, 140.0, 360.0, 220.0]])
    place = draw_map.place_tags(anchor, size, box, (640, 320))
    assert np.allclose(place[:, 2:] - place[:, :2], size)
    assert draw_map.overlap(place, box[0]) == 0.0 and place[0, 3] <= 140.0 and place[0, 3] > 110.0


def test_tags_without_room_are_left_out_and_counted(scene: Any) -> None:
    anchors, sizes = np.full((6, 2), [50.0, 20.0]), np.full((6, 2), [60.0, 12.0])
    places = draw_map.place_tags(anchors, sizes, np.hstack([anchors, anchors]), (100, 40))
    assert 1 <= np.isfinite(places[:, 0]).sum() <= 3
    endless = (*scene.things, _thing(3, "cup " * 100, CUP))
    _, missing = draw_map.draw(replace(scene, things=endless), draw_map.choose_view(scene, 320))
    assert missing == 1


def test_the_png_is_the_picture_in_256_colours() -> None:
    image = np.zeros((60, 90, 3), dtype=np.uint8)
    image[..., 0], image[..., 1] = np.linspace(0, 255, 90), np.linspace(0, 255, 60)[:, None]
    image[20, 30] = (1, 2, 253)
    data = draw_map.encode_png(image, [(1, 2, 253)])
    decoded = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR_RGB)
    assert decoded is not None and decoded.shape == image.shape and tuple(decoded[20, 30]) == (1, 2, 253)
    assert np.abs(decoded.astype(int) - image).max() <= 24
    assert data == draw_map.encode_png(image, [(1, 2, 253)])


@pytest.mark.parametrize(("p", "text"), [(0.384, "0.38"), (0.9951, ">0.99"), (1.0, "1.00"), (0.0, "0.00")])
def test_no_probability_is_rounded_to_certainty(p: float, text: str) -> None:
    assert draw_map.as_text(p) == text


def test_the_program_writes_the_same_picture_twice(
    write_out: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = write_out(_thing(1, "cup", CUP), _thing(2, "bowl", BOWL), _thing(3, "cup", -CUP, existence=0.3))
    files = [tmp_path / "a.png", tmp_path / "b.png"]
    for file in files:
        assert draw_map.main([str(out), "-o", str(file), "--width", "320", "--view-from", "20", "45"]) == 0
    assert "2 things" in capsys.readouterr().out
    assert files[0].read_bytes() == files[1].read_bytes()
    image = cv2.imread(str(files[0]))
    assert image is not None and image.shape == (160, 320, 3)
    assert draw_map.main([str(out), "-o", str(files[0]), "--width", "320", "--min-existence", "0.2"]) == 0
    assert "3 things" in capsys.readouterr().out


def test_an_empty_map_is_an_error_that_names_the_option(write_out: Callable[..., Path]) -> None:
    with pytest.raises(InputError, match=r"map\.json: expected things .* 0\.5, found none; lower --min-existence"):
        draw_map.read_scene(write_out(_thing(1, "cup", CUP, existence=0.4)))


@pytest.mark.parametrize("name", ["map.json", "cloud.ply", "trajectory.txt"])
def test_a_missing_file_is_one_line_that_names_it(
    write_out: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    out = write_out(_thing(1, "cup", CUP))
    (out / name).unlink()
    assert draw_map.main([str(out), "-o", str(tmp_path / "a.png")]) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ") and name in error and error.count("\n") == 1
    assert not (tmp_path / "a.png").exists()


def test_a_cloud_without_points_is_an_error(write_out: Callable[..., Path]) -> None:
    out = write_out(_thing(1, "cup", CUP))
    OutputFolder.open(out).write_cloud(np.empty((0, 3)), np.empty((0, 3), dtype=np.uint8))
    with pytest.raises(InputError, match=r"cloud\.ply: expected points, found none"):
        draw_map.read_scene(out)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        (["-o", "a.jpg"], "a.jpg"),
        (["--width", "20"], "--width"),
        (["--view-from", "0", "120"], "--view-from"),
    ],
)
def test_a_wrong_option_is_one_line_that_names_it(
    write_out: Callable[..., Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    changes: list[str],
    named: str,
) -> None:
    out = write_out(_thing(1, "cup", CUP))
    assert draw_map.main([str(out), "-o", str(tmp_path / "a.png"), *changes]) == 2
    assert named in capsys.readouterr().err
    assert not (tmp_path / "a.png").exists()
