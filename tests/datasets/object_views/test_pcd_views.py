"""Single-view clouds as images."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from thingmap.datasets.errors import InputError
from thingmap.datasets.object_views.pcd_views import CAMERA, pcd_views

RED = 0xC81E0A  # 200, 30, 10


def _write(path: Path, uv: np.ndarray, z: np.ndarray, axes: str = "washington") -> None:
    """A cloud of pixels (N, 2) at depths (N,), all of one colour."""
    x, y, z = CAMERA.back_project(uv, z).T
    points = np.stack([x, z, -y] if axes == "washington" else [x, y, z], axis=1)
    color = np.full((len(uv), 1), np.array(RED, np.uint32).view(np.float32), np.float32)
    header = "VERSION .7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\n"
    header += f"WIDTH {len(uv)}\nHEIGHT 1\nPOINTS {len(uv)}\nDATA binary\n"
    path.write_bytes(header.encode() + np.hstack([points.astype(np.float32), color]).tobytes())


def _board() -> tuple[np.ndarray, np.ndarray]:
    """Pixels of a board of 30 x 20 with a hole of one pixel and a window of 10 x 10."""
    row, column = np.mgrid[200:220, 300:330]
    uv = np.stack([column.ravel(), row.ravel()], axis=1).astype(float)
    hole = (uv == [303, 203]).all(axis=1)
    window = ((uv >= [312, 205]) & (uv < [322, 215])).all(axis=1)
    uv = uv[~(hole | window)]
    return uv, 0.8 + 0.001 * (uv[:, 0] - 300)


@pytest.mark.parametrize("axes", ["washington", "camera"])
def test_points_become_the_pixels_they_came_from(tmp_path: Path, axes: str) -> None:
    _write(tmp_path / "bowl_2_1_45.pcd", *_board(), axes)
    (view,) = pcd_views(tmp_path)
    assert (view.label, view.instance, view.name) == ("bowl", "bowl 2", "bowl_2_1_45")
    assert view.mask is not None and view.depth is not None
    left, top = (int(v) for v in view.xyxy[:2])
    assert view.xyxy.tolist() == [left, top, left + 30, top + 20]
    assert (view.color[view.mask] == [200, 30, 10]).all()
    expected = np.tile(0.8 + 0.001 * np.arange(30), (20, 1))
    inside = view.mask[top : top + 20, left : left + 30]
    seen = view.depth[top : top + 20, left : left + 30]
    np.testing.assert_allclose(seen[inside], expected[inside], atol=1.1e-3)  # the hole is as its neighbour
    assert inside[3, 3] and not inside[10, 16]  # the hole is closed, the window stays
    assert (view.depth[~view.mask] == 0).all()


def test_the_nearest_of_several_points_is_seen(tmp_path: Path) -> None:
    uv, z = _board()
    _write(tmp_path / "cap_1_1_1.pcd", np.vstack([uv, uv]), np.concatenate([z, z + 0.5]))
    (view,) = pcd_views(tmp_path)
    assert view.depth is not None and view.depth.max() < 0.9


def test_unusable_clouds_are_counted_and_named(tmp_path: Path) -> None:
    uv, z = _board()
    _write(tmp_path / "cap_1_1_1.pcd", uv, z)
    _write(tmp_path / "cap_1_1_2.pcd", uv[:5], z[:5])
    (tmp_path / "cap_1_1_3.pcd").write_text("no cloud\n")
    _write(tmp_path / "cap_1_1_4.pcd", uv * 4, z)
    _write(tmp_path / "scan.pcd", uv, z)
    views = pcd_views(tmp_path)
    assert [view.name for view in views] == ["cap_1_1_1"] and len(views) == 4
    for name, words in (
        ("cap_1_1_2", "5 points"),
        ("cap_1_1_3", "no keyword of PCD"),
        ("cap_1_1_4", "not seen whole"),
        ("scan", "its name is not"),
    ):
        assert words in views.skipped[name]


def test_a_folder_without_named_clouds_is_an_error(tmp_path: Path) -> None:
    _write(tmp_path / "scan.pcd", *_board())
    with pytest.raises(InputError, match=r"1 \.pcd files of other names"):
        pcd_views(tmp_path)


def test_real_clouds_are_read(real_data: Path) -> None:
    views = pcd_views(real_data / "uw_objects")
    shown = {view.name: view for view in views}
    assert len(shown) == len(views) == 18 and not views.skipped
    mug = shown["coffee_mug_2_1_122"]
    assert mug.mask is not None and mug.depth is not None
    assert 0.65 < mug.depth[mug.mask].min() < mug.depth.max() < 0.83
    assert mug.xyxy[2] - mug.xyxy[0] == pytest.approx(95, abs=1)  # columns 252 to 346, as the file says of its pixels
    red, green, blue = shown["soda_can_2_1_45"].color[shown["soda_can_2_1_45"].mask].mean(axis=0)
    assert green > red and green > blue  # a green can
