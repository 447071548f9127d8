from pathlib import Path

import cv2
import numpy as np
import pytest

from thingmap.datasets.frame import BrokenFrame, FrameProblem, Intrinsics
from thingmap.datasets.images import DepthUnit, FrameFiles, first_image_size, read_frame_images

CAMERA = Intrinsics(64, 48, 60.0, 60.0, 31.5, 23.5)
MILLIMETRES = DepthUnit(1000.0, no_reading=65535)


@pytest.fixture
def files(tmp_path: Path, write_images) -> FrameFiles:
    write_images(tmp_path / "c.png", tmp_path / "d.png")
    return FrameFiles("frame-7", tmp_path / "c.png", tmp_path / "d.png")


def problem(files: FrameFiles) -> BrokenFrame:
    with pytest.raises(BrokenFrame) as broken:
        read_frame_images(files, MILLIMETRES, CAMERA)
    assert broken.value.name == "frame-7"
    return broken.value


def test_colour_is_rgb_and_depth_is_metres_with_zero_for_no_reading(tmp_path: Path, write_images) -> None:
    rgb, raw = write_images(tmp_path / "c.png", tmp_path / "d.png", seed=3)
    raw[5, 6] = 65535
    cv2.imwrite(str(tmp_path / "d.png"), raw)
    color, depth = read_frame_images(FrameFiles("f", tmp_path / "c.png", tmp_path / "d.png"), MILLIMETRES, CAMERA)
    np.testing.assert_array_equal(color, rgb)
    assert (color.dtype, depth.dtype, depth.shape) == (np.uint8, np.float32, (48, 64))
    assert depth[5, 6] == 0 and depth[0, 0] == 0
    raw[5, 6] = 0
    np.testing.assert_allclose(depth, raw / 1000, rtol=1e-6)


def test_65535_is_a_depth_where_the_format_does_not_reserve_it(files: FrameFiles) -> None:
    cv2.imwrite(str(files.depth), np.full((48, 64), 65535, np.uint16))
    assert read_frame_images(files, DepthUnit(5000.0), CAMERA)[1].max() == pytest.approx(13.107)
    assert problem(files).problem is FrameProblem.NO_DEPTH


def test_float_depth_is_read_and_what_is_not_a_depth_is_no_reading(files: FrameFiles) -> None:
    raw = np.full((48, 64), 1.5, np.float32)
    raw[0, :4] = [np.nan, np.inf, -np.inf, -2.0]
    tiff = files.depth.with_suffix(".tiff")
    cv2.imwrite(str(tiff), raw)
    _, depth = read_frame_images(FrameFiles("f", files.color, tiff), DepthUnit(1.0), CAMERA)
    np.testing.assert_array_equal(depth[0, :5], [0, 0, 0, 0, 1.5])


def test_grey_and_transparent_colour_images_are_read_as_rgb(files: FrameFiles) -> None:
    cv2.imwrite(str(files.color), np.full((48, 64), 7, np.uint8))
    assert (read_frame_images(files, MILLIMETRES, CAMERA)[0] == 7).all()
    cv2.imwrite(str(files.color), np.full((48, 64, 4), (1, 2, 3, 128), np.uint8))
    np.testing.assert_array_equal(read_frame_images(files, MILLIMETRES, CAMERA)[0][0, 0], [3, 2, 1])


@pytest.mark.parametrize("which", ["color", "depth"])
@pytest.mark.parametrize(
    ("damage", "word"),
    [
        (lambda path: path.unlink(), "is missing"),
        (lambda path: path.write_bytes(b""), "is empty"),
        (lambda path: path.write_bytes(b"not an image"), "cannot be decoded"),
        (lambda path: path.write_bytes(path.read_bytes()[:100]), "cannot be decoded"),
        (lambda path: (path.unlink(), path.mkdir()), "directory"),
    ],
)
def test_an_image_that_cannot_be_read_breaks_the_frame(files: FrameFiles, which: str, damage, word: str) -> None:
    damage(getattr(files, which))
    broken = problem(files)
    assert broken.problem is FrameProblem.UNREADABLE
    assert getattr(files, which).name in broken.detail and word in broken.detail


@pytest.mark.parametrize("which", ["color", "depth"])
def test_an_image_of_another_size_breaks_the_frame(files: FrameFiles, which: str) -> None:
    image = cv2.imread(str(getattr(files, which)), cv2.IMREAD_UNCHANGED)
    cv2.imwrite(str(getattr(files, which)), image[:-1])
    broken = problem(files)
    assert broken.problem is FrameProblem.SIZE_MISMATCH
    assert f"{getattr(files, which).name} is 64 x 47, the camera 64 x 48" in broken.detail


@pytest.mark.parametrize("value", [0, 65535])
def test_a_depth_image_without_a_reading_breaks_the_frame(files: FrameFiles, value: int) -> None:
    cv2.imwrite(str(files.depth), np.full((48, 64), value, np.uint16))
    assert problem(files).problem is FrameProblem.NO_DEPTH


def test_a_depth_image_of_nan_breaks_the_frame(files: FrameFiles) -> None:
    tiff = files.depth.with_suffix(".tiff")
    cv2.imwrite(str(tiff), np.full((48, 64), np.nan, np.float32))
    assert problem(FrameFiles("frame-7", files.color, tiff)).problem is FrameProblem.NO_DEPTH


@pytest.mark.parametrize("image", [np.full((48, 64), 9, np.uint8), np.full((48, 64, 3), 9, np.uint16)])
def test_depth_saved_as_a_picture_breaks_the_frame(files: FrameFiles, image: np.ndarray) -> None:
    cv2.imwrite(str(files.depth), image)
    broken = problem(files)
    assert broken.problem is FrameProblem.UNREADABLE
    assert f"x {image.dtype}, depth needs one channel of uint16" in broken.detail


def test_the_first_image_that_can_be_read_gives_the_size(tmp_path: Path, files: FrameFiles) -> None:
    (tmp_path / "bad.png").write_bytes(b"bad")
    assert first_image_size([tmp_path / "none.png", tmp_path / "bad.png", files.color]) == (64, 48)
    assert first_image_size([tmp_path / "none.png"]) is None
