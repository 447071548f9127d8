"""Crops in the layout of the Washington RGB-D Object Dataset."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from thingmap.datasets.errors import InputError
from thingmap.datasets.object_views.washington import washington_views


def _write(folder: Path, name: str, seed: int = 0, size: tuple[int, int] = (40, 30)) -> tuple[np.ndarray, np.ndarray]:
    """RGB and millimetres of a crop; the object is all but a rim of 5 pixels."""
    width, height = size
    rng = np.random.default_rng(seed)
    color = rng.integers(0, 256, (height, width, 3), dtype=np.uint8)
    depth = rng.integers(600, 900, (height, width), dtype=np.uint16)
    depth[0, 0] = 0
    mask = np.zeros((height, width), np.uint8)
    mask[5:-5, 5:-5] = 255
    folder.mkdir(parents=True, exist_ok=True)
    for kind, image in (("crop", color[..., ::-1]), ("depthcrop", depth), ("maskcrop", mask)):
        assert cv2.imwrite(str(folder / f"{name}_{kind}.png"), image)
    (folder / f"{name}_loc.txt").write_text("250,180\n")
    return color, depth


def test_reads_what_was_written(tmp_path: Path) -> None:
    color, depth = _write(tmp_path / "coffee_mug" / "coffee_mug_2", "coffee_mug_2_1_10")
    (view,) = washington_views(tmp_path)
    assert (view.label, view.instance, view.name) == ("coffee mug", "coffee mug 2", "coffee_mug_2_1_10")
    assert np.array_equal(view.color, color)
    assert view.depth is not None and view.depth.dtype == np.float32
    np.testing.assert_allclose(view.depth, depth / 1000.0, atol=1e-6)
    assert view.mask is not None and view.mask.sum() == 30 * 20
    assert view.xyxy.tolist() == [5, 5, 35, 25] and view.focal == 570.3


def test_frames_come_in_natural_order(tmp_path: Path) -> None:
    for frame in (10, 2, 1):
        _write(tmp_path / "bowl" / "bowl_1", f"bowl_1_1_{frame}")
    assert [view.name for view in washington_views(tmp_path)] == ["bowl_1_1_1", "bowl_1_1_2", "bowl_1_1_10"]


def test_unusable_crops_are_counted_and_named(tmp_path: Path) -> None:
    for frame in (1, 2, 3, 4, 5):
        _write(tmp_path, f"cap_1_1_{frame}")
    (tmp_path / "cap_1_1_1_crop.png").write_bytes(b"no image")
    (tmp_path / "cap_1_1_2_depthcrop.png").unlink()
    cv2.imwrite(str(tmp_path / "cap_1_1_3_maskcrop.png"), np.zeros((30, 40), np.uint8))
    cv2.imwrite(str(tmp_path / "cap_1_1_4_maskcrop.png"), np.zeros((3, 4), np.uint8))
    _write(tmp_path, "holiday")
    views = washington_views(tmp_path)
    assert len(views) == 5 and [view.name for view in views] == ["cap_1_1_5"]
    reasons = [views.skipped[f"cap_1_1_{frame}"] for frame in (1, 2, 3, 4)]
    for reason, words in zip(reasons, ("cannot be decoded", "missing", "no pixel", "4 x 3"), strict=True):
        assert words in reason
    assert "holiday" in views.skipped


def test_crops_without_any_depth_or_mask_are_colour_views(tmp_path: Path) -> None:
    _write(tmp_path, "cap_1_1_1")
    (tmp_path / "cap_1_1_1_depthcrop.png").unlink()
    (tmp_path / "cap_1_1_1_maskcrop.png").unlink()
    (view,) = washington_views(tmp_path)
    assert view.depth is None and view.mask is None and view.xyxy.tolist() == [0, 0, 40, 30]


def test_a_folder_without_crops_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"_crop\.png"):
        washington_views(tmp_path)
