"""Files of other programs, written by hand."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from thingmap.datasets.errors import InputError, UserError
from thingmap.detectors.coco import COCO_80
from thingmap.detectors.recorded import RecordedDetections, RecordedFormat
from thingmap.detectors.recorded.recording import MatchedBy, frame_key, leading_number

CUP, CHAIR = COCO_80.index("cup"), COCO_80.index("chair")
CATEGORIES = [{"id": 9, "name": "bowl"}, {"id": 5, "name": "mug"}]
IMAGES = [
    {"id": 100, "file_name": "rgb/frame-000000.color.png", "width": 64, "height": 48},
    {"id": 101, "file_name": "rgb/frame-000001.color.png"},
]


def save(path: Path, content) -> Path:
    path.write_text(json.dumps(content))
    return path


def result(image_id, category_id=5, bbox=(1, 2, 10, 20), **more) -> dict:
    return {"image_id": image_id, "category_id": category_id, "bbox": list(bbox), "score": 0.5} | more


@pytest.mark.parametrize(
    ("name", "key"),
    [
        ("frame-000000", "frame-000000"),
        ("frame-000000.color", "frame-000000"),
        ("a/b/frame-000000.color.jpg", "frame-000000"),
        ("C:\\rgb\\0001.PNG", "0001"),
        ("1311868164.363181", "1311868164.363181"),
        ("1311868164.363181.png", "1311868164.363181"),
        (".png", ".png"),
    ],
)
def test_names_that_agree(name: str, key: str):
    assert frame_key(name) == key


def test_leading_numbers():
    assert leading_number("0012_rgb_raw.jpg") == 12
    assert leading_number("frame-000012") is None


def test_coco_with_everything_in_one_file(tmp_path: Path, make_frame):
    annotations = [result(100), result(100, 9, score=0.25)]
    path = save(tmp_path / "all.json", {"images": IMAGES, "categories": CATEGORIES, "annotations": annotations})
    recorded = RecordedDetections(path)
    assert recorded.format is RecordedFormat.COCO and recorded.classes == ("mug", "bowl")
    found = recorded(make_frame("frame-000000"))
    assert found.xyxy.tolist() == [[1, 2, 11, 22]] * 2 and found.class_id.tolist() == [0, 1]
    assert found.confidence.tolist() == [0.5, 0.25]
    # The second image is listed, so it was looked at and nothing was found.
    assert len(recorded(make_frame("frame-000001"))) == 0 and recorded.missing == ()
    assert len(recorded(make_frame("frame-000002"))) == 0 and recorded.missing == ("frame-000002",)


@pytest.mark.parametrize("given", [True, False])
def test_coco_results_with_a_list_of_images_beside(tmp_path: Path, make_frame, given: bool):
    listing = {"images": IMAGES, "categories": CATEGORIES, "annotations": []}
    images = save(tmp_path / ("other.json" if given else "annotations.json"), listing)
    path = save(tmp_path / "results.json", [result(101, 9)])
    recorded = RecordedDetections(path, images=images if given else None)
    assert recorded(make_frame("frame-000001")).class_id.tolist() == [1]
    assert recorded.matched_by is MatchedBy.NAME


def test_coco_results_by_name_with_cocos_own_ids(tmp_path: Path, make_frame):
    path = save(tmp_path / "results.json", [result("frame-000003", 47), result("b", 62)])
    recorded = RecordedDetections(path)
    assert recorded.classes == COCO_80 and recorded.matched_by is MatchedBy.NAME
    assert recorded(make_frame("frame-000003.color")).class_id.tolist() == [CUP]
    assert recorded(make_frame("b")).class_id.tolist() == [CHAIR]


def test_coco_results_by_number_say_so(tmp_path: Path, make_frame, caplog):
    recorded = RecordedDetections(save(tmp_path / "results.json", [result(3, 47)]))
    assert recorded.matched_by is MatchedBy.INDEX
    assert "taken as positions from 0" in caplog.text
    assert recorded(make_frame("anything", index=3)).class_id.tolist() == [CUP]
    assert len(recorded(make_frame("3", index=0))) == 0
    recorded.check_against(["a", "b", "c", "d"])
    with pytest.raises(InputError, match="by position in the sequence"):
        recorded.check_against(["a", "b", "c"])


def test_coco_of_images_of_another_size(tmp_path: Path, make_frame):
    path = save(tmp_path / "a.json", {"images": IMAGES, "categories": CATEGORIES, "annotations": []})
    with pytest.raises(InputError, match=r"images of 32x24 \(frame-000000\), found 64x48"):
        RecordedDetections(path)(make_frame("frame-000000", size=(32, 24)))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ([result(1) | {"bbox": [1, 2, 3]}], r"frame 1: a box needs 4 numbers, but got \[1, 2, 3\]"),
        ([result(1) | {"bbox": "1 2 3 4"}], "a box needs 4 numbers"),
        ([result(1, 12)], "class 12 is not among the 80 known"),
        ([result(1, bbox=(0, 0, -1, 1))], "x1 <= x2"),
        ([result(1, 47, score="high")], "frame 1: "),
        ([result(1, 47, score=None)], "a row without any"),
        ([result(1, 47), result("a", 47)], "some image ids are names and some are numbers"),
        ([result(1, 47), {"category_id": 1}], "result 1: no 'image_id'"),
        ([result(1, 47), 7], "result 1: "),
        ({"annotations": []}, "found no 'images'"),
        ({"annotations": [], "images": [{"id": 1}], "categories": []}, "found image 0: no 'file_name'"),
        ({"annotations": [], "images": [*IMAGES, IMAGES[0]], "categories": []}, "two frames named 'frame-000000'"),
        (
            {"annotations": [], "images": [IMAGES[0], IMAGES[1] | {"id": 100}], "categories": []},
            "two images with id 100",
        ),
        ({"annotations": [result(7)], "images": IMAGES, "categories": CATEGORIES}, "image_id 7 is not among the 2"),
    ],
)
def test_wrong_coco(tmp_path: Path, content, message: str):
    path = save(tmp_path / "a.json", content)
    with pytest.raises(InputError, match=message) as error:
        RecordedDetections(path)
    assert error.value.path == path and "format coco" in error.value.expected


def test_parts_of_foreign_formats_are_read(tmp_path: Path, make_frame):
    coco = save(tmp_path / "coco.json", [result("a", 47, part=3), result("a", 47), result("b", 47, part=1)])
    recorded = RecordedDetections(coco)
    assert recorded(make_frame("a")).part.tolist() == [3, 0] and recorded(make_frame("b")).part.tolist() == [1]
    one = {"category_id": CUP, "detection_score": 0.5, "bbox": [1, 2, 3, 4]}
    frames = [{"file_name": "a.png", "detections": [one, one | {"part": 4}]}, {"file_name": "b.png", "detections": []}]
    recorded = RecordedDetections(save(tmp_path / "oaslam.json", frames))
    assert recorded(make_frame("a")).part.tolist() == [0, 4] and len(recorded(make_frame("b"))) == 0


@pytest.mark.parametrize("part", [5, -1, 0.5, None, "left", {"left": 1}])
def test_parts_that_are_none(tmp_path: Path, part):
    with pytest.raises(InputError, match="frame 'a': part must hold values of Part"):
        RecordedDetections(save(tmp_path / "coco.json", [result("a", 47), result("a", 47, part=part)]))


@pytest.mark.parametrize("columns", [7, 8])
def test_formats_without_room_for_parts_refuse_them(tmp_path: Path, columns: int):
    (tmp_path / "000.txt").write_text(" ".join(["0.5"] * columns))
    with pytest.raises(InputError, match=f"{columns} numbers instead of 5 or 6"):
        RecordedDetections(tmp_path)
    with pytest.raises(InputError, match=f"{columns} numbers instead of 5"):
        RecordedDetections(tmp_path, "boxes", label="cup")


def test_a_list_of_images_that_is_none(tmp_path: Path):
    path = save(tmp_path / "a.json", [result(1)])
    with pytest.raises(InputError, match="no such file"):
        RecordedDetections(path, images=tmp_path / "no.json")
    with pytest.raises(InputError, match=r"together with other.json: no 'images'"):
        RecordedDetections(path, images=save(tmp_path / "other.json", {}))


def oaslam(**change) -> list[dict]:
    one = {"category_id": 41, "detection_score": 0.5, "bbox": [10.0, 20.0, 30.0, 40.0], "ellipse": [1, 2, 3, 4, 5]}
    return [{"file_name": "1.25.png", "detections": [one | change]}, {"file_name": "1.50.png", "detections": []}]


def test_oaslam_has_corners_and_counts_classes_from_zero(tmp_path: Path, make_frame):
    recorded = RecordedDetections(save(tmp_path / "a.json", oaslam()))
    assert recorded.format is RecordedFormat.OASLAM
    found = recorded(make_frame("1.25"))
    assert found.xyxy.tolist() == [[10, 20, 30, 40]]
    assert found.class_id.tolist() == [CUP] and found.confidence.tolist() == [0.5]
    assert np.isnan(found.scores).sum() == 79
    assert len(recorded(make_frame("1.50"))) == 0 and recorded.missing == ()


def test_oaslam_with_other_names(tmp_path: Path, make_frame):
    path = save(tmp_path / "a.json", oaslam(category_id=1))
    assert RecordedDetections(path, names=("horse", "statue"))(make_frame("1.25")).class_id.tolist() == [1]
    with pytest.raises(InputError, match=r"frame 0: class_id must be one of 0..0, but got 1"):
        RecordedDetections(path, names=("horse",))
    with pytest.raises(InputError, match="frame 0: no 'detection_score'"):
        item = oaslam()
        del item[0]["detections"][0]["detection_score"]
        RecordedDetections(save(path, item))


def yolo(folder: Path, **files: str) -> Path:
    (folder / "labels").mkdir(parents=True)
    for name, text in files.items():
        (folder / "labels" / f"{name}.txt").write_text(text)
    return folder


@pytest.mark.parametrize("inner", [False, True])
def test_yolo(tmp_path: Path, make_frame, inner: bool):
    folder = yolo(tmp_path, a="1 0.5 0.5 0.25 0.5 0.75\n0 0.0 1.0 0.5 0.5 0.5\n", b="", c="0 0.5 0.5 1 1\n")
    (folder / "data.yaml").write_text("names: [cup, chair]")
    recorded = RecordedDetections(folder / "labels" if inner else folder)
    assert recorded.format is RecordedFormat.YOLO and recorded.classes == ("cup", "chair")
    found = recorded(make_frame("a.color", size=(64, 48)))
    # The second box is half outside.
    assert found.xyxy.tolist() == [[24, 12, 40, 36], [0, 36, 16, 48]]
    assert found.class_id.tolist() == [1, 0] and found.confidence.tolist() == [0.75, 0.5]
    assert recorded(make_frame("c")).confidence.tolist() == [1.0]
    assert len(recorded(make_frame("b"))) == 0 and recorded.missing == ()
    assert len(recorded(make_frame("d"))) == 0 and recorded.missing == ("d",)


def test_yolo_names(tmp_path: Path):
    folder = yolo(tmp_path, a="0 0.5 0.5 1 1")
    assert RecordedDetections(folder).classes == COCO_80
    (folder / "labels" / "classes.txt").write_text("cup\nchair\n")
    assert RecordedDetections(folder).classes == ("cup", "chair")
    assert RecordedDetections(folder, names=("mug",)).classes == ("mug",)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("2 0.5 0.5 1 1", r"a.txt: class_id must be one of 0..1, but got 2"),
        ("0.5 0.5 0.5 1 1", "class_id must be one of"),
        ("0 0.5 0.5 1", "a.txt, line 1: 4 numbers instead of 5 or 6"),
        ("0 0.5 0.5 1 1 0.5\n\n0 0.5 0.5 1 1", "a.txt, line 3: 5 numbers instead of 6"),
        ("0 0.5 0.5 1 1 0.5 0.5 0.5", "8 numbers instead of"),
        ("cup 0.5 0.5 1 1", "a.txt, line 1: 'cup 0.5 0.5 1 1' instead of numbers"),
        ("0 175 24 385 373", "not in units of the image.*format=boxes"),
        ("0 0.5 0.5 nan 1", "a.txt: "),
        ("0 0.5 0.5 1 1 1.5", "but got 1.5"),
    ],
)
def test_wrong_yolo(tmp_path: Path, text: str, message: str):
    with pytest.raises(InputError, match=message):
        RecordedDetections(yolo(tmp_path, a=text), names=("cup", "chair"))


def test_boxes(tmp_path: Path, make_frame):
    (tmp_path / "0000_yolo2_0.15.txt").write_text("10\t20\t30\t60\t0.42\n")
    (tmp_path / "0001_yolo2_0.15.txt").write_text("")
    (tmp_path / "readme.txt").write_text("x y w h score")
    recorded = RecordedDetections(tmp_path, "boxes", label="cabinet")
    assert recorded.classes == ("cabinet",) and recorded.matched_by is MatchedBy.NUMBER
    found = recorded(make_frame("0000_rgb_raw"))
    assert found.xyxy.tolist() == [[10, 20, 40, 48]] and found.confidence.tolist() == [0.42]
    assert len(recorded(make_frame("0001_rgb_raw"))) == 0 and recorded.missing == ()
    recorded.check_against(["0000_rgb_raw"])
    with pytest.raises(InputError, match="by number at the start of the name"):
        recorded.check_against(["rgb_0000"])


def test_wrong_boxes(tmp_path: Path):
    (tmp_path / "0000_a.txt").write_text("10 20 30 40 0.42")
    with pytest.raises(UserError, match="label=cabinet"):
        RecordedDetections(tmp_path, "boxes")
    (tmp_path / "000_b.txt").write_text("10 20 30 40 0.42")
    with pytest.raises(InputError, match="two frames named 0"):
        RecordedDetections(tmp_path, "boxes", label="cabinet")


def test_folders_without_labels(tmp_path: Path):
    (tmp_path / "classes.txt").write_text("cup")
    with pytest.raises(InputError, match="expected detections in format yolo, found no"):
        RecordedDetections(tmp_path)
    with pytest.raises(InputError, match=r"no \.txt files whose names start with a number"):
        RecordedDetections(tmp_path, "boxes", label="cup")


def test_recorded_boxes_of_the_cabinet(real_data: Path, make_frame):
    folder = real_data / "tum_fr3_cabinet" / "data" / "filter_2d_obj_txts"
    recorded = RecordedDetections(folder, "boxes", label="cabinet")
    names = sorted(path.stem for path in (folder.parent / "raw_imgs").iterdir())
    recorded.check_against(names)
    found = [recorded(make_frame(name, size=(640, 480))) for name in names]
    assert found[0].xyxy.tolist() == [[175, 24, 560, 397]] and found[0].confidence.tolist() == [0.42]
    assert recorded.missing == () and sum(map(len, found)) > 40
