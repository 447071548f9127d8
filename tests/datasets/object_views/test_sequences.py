"""Views and backgrounds from sequences, and the one way in to all sources."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.io import savemat

from thingmap.datasets.errors import InputError, UserError
from thingmap.datasets.frame import BrokenFrame, Frame, FrameProblem, Intrinsics
from thingmap.datasets.object_views.backgrounds import Backgrounds, open_backgrounds
from thingmap.datasets.object_views.object_view import BrokenView
from thingmap.datasets.object_views.open import open_object_views
from thingmap.datasets.object_views.sequence_views import sequence_views
from thingmap.datasets.open import open_sequence
from thingmap.datasets.truth import FrameTruth, TrueObject
from thingmap.datasets.views import subset

CAMERA = Intrinsics(160, 120, 130.0, 130.0, 79.5, 59.5)


class Plain:
    """Frames of one colour each; the second is broken."""

    name = "plain"
    intrinsics = CAMERA
    poses = gravity = None
    stamps = np.arange(6.0)
    names = tuple(f"f{k}" for k in range(6))

    def __len__(self) -> int:
        return 6

    def __getitem__(self, index: int) -> Frame:
        if index == 1:
            raise BrokenFrame("f1", FrameProblem.NO_DEPTH)
        color = np.full((120, 160, 3), 10 * index, np.uint8)
        return Frame(index, f"f{index}", float(index), color, np.ones((120, 160), np.float32), CAMERA)

    def __iter__(self) -> Iterator[Frame]:
        return (self[k] for k in range(6))


class Known(Plain):
    """With a mug that is seen well, a cap half hidden, a bowl that leaves the image and a tiny can."""

    name = "known"
    classes = ("coffee mug", "cap", "bowl", "soda can")
    objects = tuple(
        TrueObject(k, label, np.zeros(3), np.ones(3), 0.0)
        for k, label in enumerate(("coffee_mug", "cap", "bowl", "can"))
    )

    def truth(self, index: int) -> FrameTruth:
        xyxy = np.array([[39.5, 29.5, 79.5, 69.5], [90, 10, 120, 40], [140, 90, 170, 110], [5, 5, 10, 10]])
        return FrameTruth(np.arange(4), xyxy + index, xyxy, np.array([1.0, 0.5, 0.9, 1.0]))


def test_views_are_of_whole_objects_that_are_seen() -> None:
    views = sequence_views(Known(), stride=2)
    assert [entry.label for entry in views.entries] == ["coffee mug"] * 3
    first, second, _ = views
    assert first.mask is None and first.depth is not None and first.focal == 130.0
    assert (first.xyxy[2:] - first.xyxy[:2]).tolist() == [40, 40]
    assert first.xyxy.tolist() == [24, 24, 64, 64]  # of (40, 30, 80, 70), pixels' outer edges, within the margin
    assert (second.color == 20).all() and first.instance == second.instance != ""
    assert len(sequence_views(Known(), stride=2, visibility=0.4)) == 6


def test_a_broken_frame_makes_its_views_unusable() -> None:
    views = sequence_views(Known(), stride=1)
    assert len(list(views)) == 5 and len(views) == 6
    assert "no valid depth" in views.skipped["known f1 object 0"]


def test_a_sequence_without_truth_shows_no_known_objects() -> None:
    with pytest.raises(UserError, match="whose objects are known"):
        sequence_views(Plain())


def test_backgrounds_know_the_objects_in_them() -> None:
    backgrounds = Backgrounds(Plain(), Known(), stride=2, max_frames=2)
    assert backgrounds.names == ("plain f0", "plain f2", "known f0", "known f2") and len(backgrounds) == 4
    plain, _, known, later = backgrounds
    assert plain.labels == () and plain.xyxy.shape == (0, 4) and plain.depth is not None
    assert known.labels == ("coffee mug", "cap", "bowl", "can")
    assert known.xyxy[0].tolist() == [40, 30, 80, 70] and later.xyxy[0].tolist() == [42, 32, 82, 72]
    assert known.xyxy[2].tolist() == [140.5, 90.5, 160, 110.5]  # cut to the image
    assert known.visibility.tolist() == [1.0, 0.5, 0.9, 1.0]


def test_backgrounds_of_part_of_a_sequence_have_that_parts_boxes() -> None:
    part = Backgrounds(subset(Known(), stride=3))
    assert part[1].name == "known f3" and part[1].xyxy[0].tolist() == [43, 33, 83, 73]


def test_broken_frames_are_counted_and_named() -> None:
    backgrounds = Backgrounds(Plain())
    assert len(list(backgrounds)) == 5 and len(backgrounds) == 6
    assert "no valid depth" in backgrounds.skipped["plain f1"]
    with pytest.raises(BrokenView):
        backgrounds[1]


@pytest.mark.parametrize("wrong", [{"stride": 0}, {"max_frames": 0}])
def test_no_frames_are_an_error(wrong: dict[str, int]) -> None:
    with pytest.raises(UserError):
        Backgrounds(Plain(), **wrong)


def _write_coco(folder: Path) -> None:
    for k in range(3):
        cv2.imwrite(str(folder / f"{k}.png"), np.full((120, 160, 3), 40 * k, np.uint8))
    images = [{"id": k, "file_name": f"{k}.png", "width": 160, "height": 120} for k in range(3)]
    boxes = [{"id": 1, "image_id": 2, "category_id": 1, "bbox": [10, 10, 40, 50], "iscrowd": 0}]
    record = {"images": images, "annotations": boxes, "categories": [{"id": 1, "name": "cup"}]}
    (folder / "annotations.json").write_text(json.dumps(record))


def test_a_coco_folder_gives_views_and_backgrounds(tmp_path: Path) -> None:
    _write_coco(tmp_path)
    assert open_object_views(tmp_path).labels == ("cup",)
    backgrounds = open_backgrounds([str(tmp_path)], stride=2)
    first, last = backgrounds
    assert first.depth is None and first.labels == () and last.labels == ("cup",)
    assert last.xyxy.tolist() == [[10, 10, 50, 60]] and (last.color == 80).all()


def test_annotated_videos_of_rgbd_scenes_v1_are_known(tmp_path: Path, write_images) -> None:
    folder = tmp_path / "desk_1"
    for number in (1, 2):
        stem = f"desk_1_{number}"
        write_images(folder / f"{stem}.png", folder / f"{stem}_depth.png", number, size=(640, 480))
    boxes = np.empty((1, 2), dtype=object)
    fields = [(name, object) for name in ("category", "instance", "top", "bottom", "left", "right")]
    boxes[0, 0], boxes[0, 1] = np.empty((1, 1), dtype=fields), np.zeros((0, 0))
    boxes[0, 0][0, 0] = ("coffee_mug", 5, 158, 259, 182, 295)
    savemat(tmp_path / "desk_1.mat", {"bboxes": boxes})
    (view,) = sequence_views(open_sequence(folder), stride=1)
    assert view.label == "coffee mug" and (view.xyxy[2:] - view.xyxy[:2]).tolist() == [113, 101]
    first, second = open_backgrounds([str(folder)])
    assert first.labels == ("coffee mug",) and second.labels == ()
    assert first.xyxy.tolist() == [[181.5, 157.5, 294.5, 258.5]]  # the distribution counts pixels from 1
    assert open_backgrounds([folder], stride=2).names == ("desk_1 desk_1_1",)
    (part,) = Backgrounds(subset(open_sequence(folder), max_frames=1))
    assert part.labels == ("coffee mug",)


def test_a_rendered_sequence_gives_views_and_backgrounds() -> None:
    line = "synth:tabletop?seed=3&frames=11&width=320&clutter=low"
    views = open_object_views(line)
    labels = {view.label for view in views}
    assert labels and labels <= {"bowl", "cap", "cereal box", "coffee mug", "soda can", "flashlight", "bottle"}
    (background,) = open_backgrounds([line], max_frames=1)
    assert background.color.shape == (240, 320, 3) and len(background.labels) == len(background.xyxy) > 0


@pytest.mark.parametrize(
    ("files", "words"),
    [
        ((), "an empty folder"),
        (("notes.txt",), r"notes\.txt"),
        (("bowl_1_1_1_crop.png", "mug.obj"), "crops, meshes"),
        (("holiday_crop.png",), "other names"),
    ],
)
def test_folders_that_cannot_be_used_are_errors(tmp_path: Path, files: tuple[str, ...], words: str) -> None:
    for name in files:
        (tmp_path / name).touch()
    with pytest.raises(InputError, match=words):
        open_object_views(tmp_path)


def test_a_source_without_usable_views_says_why(tmp_path: Path) -> None:
    _write_coco(tmp_path)
    record = json.loads((tmp_path / "annotations.json").read_text())
    record["annotations"][0]["iscrowd"] = 1
    (tmp_path / "annotations.json").write_text(json.dumps(record))
    with pytest.raises(InputError, match="crowd"):
        open_object_views(tmp_path)


def test_what_is_not_there_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such folder"):
        open_object_views(tmp_path / "nowhere")


@pytest.mark.parametrize("folder", ["uw_objects", "ycb"])
def test_real_folders_are_recognised(real_data: Path, folder: str) -> None:
    views = open_object_views(real_data / folder)
    assert {"bowl", "coffee mug"} <= set(views.labels)
    (view,) = views.select([0])
    assert view.mask is not None and view.mask.any()
