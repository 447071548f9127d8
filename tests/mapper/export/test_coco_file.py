"""COCO annotations, read by pycocotools and compared with the truth of the rendered sample."""

from __future__ import annotations

import json
from collections.abc import Callable

import cv2
import numpy as np
import pytest

from thingmap.datasets.errors import UserError
from thingmap.datasets.synthetic.sample import TabletopSequence
from thingmap.mapper.evaluation.boxes.projection import project_cylinders
from thingmap.mapper.export.coco_file import export_coco
from thingmap.mapper.map.object_map import MapFrame
from thingmap.mapper.map.store import OutputFolder
from thingmap.mapper.map.up_direction import UpDirection

SAMPLE = "sample:tabletop?frames=80&width=320"
EVERY = 16


@pytest.fixture(scope="module")
def true_folder(sample: TabletopSequence, make_thing, make_map, tmp_path_factory) -> OutputFolder:
    """A map that is right in everything: the sample's truth, in the dataset's axes, with its true path."""
    objects = sample.objects
    things = [
        make_thing(one.id, one.label, position=one.position, size=one.size, yaw=one.yaw, existence=0.9)
        for one in objects
    ]
    up = UpDirection(np.array([0.0, 0.0, 1.0]), 0.0, "gravity file")
    folder = OutputFolder.create(tmp_path_factory.mktemp("coco") / "out")
    changes = {"classes": sample.classes, "frame": MapFrame.DATASET, "up": up, "camera": sample.intrinsics}
    folder.write_map(make_map(*things, **changes))
    assert sample.poses is not None
    folder.write_trajectory(sample.stamps, sample.poses)
    folder.write_report({"command": {"sequence": SAMPLE}})
    return folder


@pytest.fixture(scope="module")
def annotated(true_folder: OutputFolder, tmp_path_factory):
    """What pycocotools makes of the file, and what the file holds."""
    coco = pytest.importorskip("pycocotools.coco", reason="pycocotools is not installed")
    file = tmp_path_factory.mktemp("coco") / "sample.coco.json"
    count = export_coco(true_folder, file, every=EVERY)
    index = coco.COCO(str(file))
    assert len(index.getAnnIds()) == count
    return index


def iou(one: np.ndarray, other: np.ndarray) -> float:
    inner = np.minimum(one[2:], other[2:]) - np.maximum(one[:2], other[:2])
    if (inner <= 0).any():
        return 0.0
    area, both = float(np.prod(inner)), np.prod(one[2:] - one[:2]) + np.prod(other[2:] - other[:2])
    return area / (float(both) - area)


def test_boxes_are_those_of_the_truth(annotated, sample):
    """Mean IoU with the boxes of the true silhouettes was 0.855, the least 0.73, visibility 0.026 off on the mean."""
    overlaps, gaps, found = [], [], 0
    for picture in annotated.loadImgs(annotated.getImgIds()):
        index = int(np.argmin(np.abs(sample.stamps - picture["stamp"])))
        truth = sample.truth(index)
        high = np.array([sample.intrinsics.width, sample.intrinsics.height] * 2)
        boxes = annotated.loadAnns(annotated.getAnnIds(imgIds=[picture["id"]]))
        found += len(boxes)
        for one in boxes:
            row = truth.object_id.tolist().index(int(one["thing"].split("-")[1]))
            x, y, width, height = one["bbox"]
            assert min(x, y) >= 0 and x + width <= high[0] + 1e-3 and y + height <= high[1] + 1e-3
            expected = np.clip(truth.xyxy[row] + 0.5, 0, high)
            overlaps.append(iou(np.array([x, y, x + width, y + height]), expected))
            gaps.append(one["visibility"] - truth.visibility[row])
        seen = {int(number) for number in truth.object_id[truth.visibility > 0.5]}
        assert seen <= {int(one["thing"].split("-")[1]) for one in boxes}
    assert found > 20
    assert np.mean(overlaps) > 0.83 and np.min(overlaps) > 0.65
    assert np.mean(np.abs(gaps)) < 0.05


def test_images_name_the_frames(annotated, sample):
    pictures = annotated.loadImgs(annotated.getImgIds())
    names = list(sample.names)[::EVERY]
    assert [one["file_name"] for one in pictures] == [f"{name}.png" for name in names]
    assert {(one["width"], one["height"]) for one in pictures} == {(320, 240)}
    np.testing.assert_allclose(pictures[2]["T_world_camera"], sample.poses[2 * EVERY], atol=2e-6)
    assert [one["name"] for one in annotated.loadCats(annotated.getCatIds())] == list(sample.classes)


def test_annotations_carry_what_the_map_says(annotated, sample):
    labels = {f"thing-{one.id:04d}": one.label for one in sample.objects}
    for one in annotated.loadAnns(annotated.getAnnIds()):
        assert annotated.loadCats([one["category_id"]])[0]["name"] == labels[one["thing"]]
        assert (one["existence"], one["probability"], one["iscrowd"]) == (0.9, 0.9, 0)
        assert one["area"] == pytest.approx(one["bbox"][2] * one["bbox"][3], abs=0.5)
        assert one["visibility"] >= 0.25 and one["id"] > 0


def test_cocoeval_finds_every_box_again(annotated, tmp_path):
    """The file stands as ground truth for COCO's own evaluation."""
    evaluation = pytest.importorskip("pycocotools.cocoeval")
    names = ("image_id", "category_id", "bbox")
    found = [{name: one[name] for name in names} | {"score": 1.0} for one in annotated.dataset["annotations"]]
    judged = evaluation.COCOeval(annotated, annotated.loadRes(found), "bbox")
    judged.evaluate()
    judged.accumulate()
    judged.summarize()
    assert judged.stats[0] == pytest.approx(1.0)


def test_less_is_annotated_where_more_must_be_seen(true_folder, tmp_path):
    every = {"every": 40}
    counts = [export_coco(true_folder, tmp_path / "a.json", min_visibility=v, **every) for v in (0.0, 0.5, 1.0)]
    assert counts[0] >= counts[1] > counts[2]
    assert export_coco(true_folder, tmp_path / "a.json", min_existence=0.95, **every) == 0


@pytest.fixture
def wall_folder(folder: OutputFolder) -> OutputFolder:
    """The two things of `folder` behind a wall of points that hides the cup's left half from the first camera."""
    y, x = np.mgrid[-0.3:0.3:0.01, -0.3:-0.005:0.01]
    points = np.stack([x.ravel(), y.ravel(), np.full(x.size, 0.7)], axis=1)
    folder.write_cloud(points, np.zeros((len(points), 3), dtype=np.uint8))
    folder.write_trajectory(np.zeros(1), np.eye(4)[None])
    return folder


def test_without_the_sequence_the_cloud_hides_things(wall_folder, tmp_path):
    said: list[str] = []
    export_coco(wall_folder, tmp_path / "a.json", min_visibility=0.0, say=said.append)
    document = json.loads((tmp_path / "a.json").read_text())
    cup = next(one for one in document["annotations"] if one["thing"] == "thing-0001")
    assert cup["visibility"] == pytest.approx(0.5, abs=0.1)
    assert document["images"][0]["file_name"] == "0.000000.png"
    assert document["info"]["visibility"].startswith("by the map's cloud")
    assert len(said) == 1 and "the map's cloud tells" in said[0]


def test_boxes_do_not_depend_on_what_tells_visibility(wall_folder, tmp_path):
    export_coco(wall_folder, tmp_path / "a.json", min_visibility=0.0)
    object_map = wall_folder.read_map()
    camera = object_map.camera
    assert camera is not None
    expected = project_cylinders(object_map.things, np.eye(4), object_map.R_world_upright, camera)[0] + 0.5
    annotations = json.loads((tmp_path / "a.json").read_text())["annotations"]
    x, y, width, height = next(one["bbox"] for one in annotations if one["thing"] == "thing-0001")
    np.testing.assert_allclose([x, y, x + width, y + height], np.clip(expected, 0, [64, 48, 64, 48]), atol=1e-3)


def test_file_names_are_those_of_the_recording(folder, tmp_path, write_recording: Callable[..., None]):
    write_recording(tmp_path / "gone", 5)  # where the report says that the sequence is
    said: list[str] = []
    export_coco(folder, tmp_path / "a.json", every=2, say=said.append)
    pictures = json.loads((tmp_path / "a.json").read_text())["images"]
    assert [one["file_name"] for one in pictures] == [f"color/1{n}.png" for n in ("0.0", "0.2", "0.4")]
    assert not said
    for one in pictures:
        assert (tmp_path / "gone" / one["file_name"]).is_file()


def test_another_sequence_is_refused(folder, tmp_path, write_recording):
    write_recording(tmp_path / "short", 2)
    with pytest.raises(UserError, match="3 of its 5 mapped frames are not in"):
        export_coco(folder, tmp_path / "a.json", sequence=str(tmp_path / "short"))
    with pytest.raises(UserError, match="nowhere"):
        export_coco(folder, tmp_path / "a.json", sequence=str(tmp_path / "nowhere"))


def test_neither_sequence_nor_cloud(folder, tmp_path):
    folder.cloud_file.unlink()
    with pytest.raises(UserError, match="has no cloud"):
        export_coco(folder, tmp_path / "a.json")
    assert not (tmp_path / "a.json").exists()


@pytest.fixture
def write_recording() -> Callable[..., None]:
    """`write_recording(path, frames)`: a folder of grey images, named by stamps from 10 s on in steps of 0.1 s."""

    def write(path, frames: int) -> None:
        for name in ("color", "depth"):
            (path / name).mkdir(parents=True)
        for k in range(frames):
            stem = f"{10.0 + 0.1 * k:.1f}"
            cv2.imwrite(str(path / "color" / f"{stem}.png"), np.full((48, 64, 3), 100, dtype=np.uint8))
            cv2.imwrite(str(path / "depth" / f"{stem}.png"), np.full((48, 64), 5000, dtype=np.uint16))
        camera = {"width": 64, "height": 48, "fx": 60.0, "fy": 60.0, "cx": 31.5, "cy": 23.5, "depth_scale": 1000.0}
        (path / "intrinsics.json").write_text(json.dumps(camera))

    return write
