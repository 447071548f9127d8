"""`thingmap train hog`: from a folder of annotated images to a detector, and on after Ctrl-C."""

import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from thingmap.detectors.hog.channels import Channels
from thingmap.detectors.hog.model import load_model
from thingmap.detectors.hog.training import train as algorithm
from thingmap.mapper.cli.main import app


def thingmap(*arguments: object):
    return CliRunner().invoke(app, [str(argument) for argument in arguments], prog_name="thingmap")


def refused(*arguments: object) -> str:
    result = thingmap("train", "hog", *arguments)
    assert result.exit_code == 2, result.output
    last = result.stderr.splitlines()[-1]
    assert last.startswith("error: ") and result.stderr.count("error:") == 1, result.stderr
    return last


def write_coco(folder: Path, count: int, labels: tuple[str, ...]) -> Path:
    """Images of 160 x 120 pixels with one disc or square each, 60 pixels wide; none where there are no labels."""
    folder.mkdir()
    rng = np.random.default_rng(len(labels))
    images, annotations = [], []
    for k in range(count):
        image = cv2.resize(rng.integers(0, 160, (5, 7, 3)).astype(np.uint8), (160, 120), interpolation=cv2.INTER_CUBIC)
        images.append({"id": k, "file_name": f"{k:03d}.png", "width": 160, "height": 120})
        if labels:
            x, y = (int(v) for v in rng.integers([10, 10], [90, 50]))
            if k % len(labels):
                image[y : y + 60, x : x + 60] = 230
            else:
                cv2.circle(image, (x + 30, y + 30), 29, (230, 230, 230), -1)
            box = {"bbox": [x, y, 60, 60], "category_id": k % len(labels) + 1, "area": 3600, "iscrowd": 0}
            annotations.append({"id": k, "image_id": k, **box})
        cv2.imwrite(str(folder / f"{k:03d}.png"), image)
    categories = [{"id": k + 1, "name": name} for k, name in enumerate(labels)]
    document = {"images": images, "annotations": annotations, "categories": categories}
    (folder / "annotations.json").write_text(json.dumps(document))
    return folder


@pytest.fixture(scope="module")
def sources(tmp_path_factory) -> tuple[object, ...]:
    """Options: twelve pictures of each class, twelve of a wall, few rounds."""
    folder = tmp_path_factory.mktemp("pictures")
    things = write_coco(folder / "my things", 24, ("disc", "square"))
    walls = write_coco(folder / "walls", 12, ())
    settings = ("--channels", "rgb", "--rounds", 2, "--stride", 1)
    return ("--objects", things, "--background", walls, *settings)


@pytest.fixture(scope="module")
def trained(sources, tmp_path_factory) -> tuple[Path, str, str]:
    output = tmp_path_factory.mktemp("trained") / "new" / "my model.npz"
    result = thingmap("train", "hog", *sources, "-o", output)
    assert result.exit_code == 0, result.stderr
    return output, result.stdout, result.stderr


def test_a_model_and_what_is_said_of_it(trained):
    output, said, progress = trained
    model = load_model(output)
    assert model.classes == ("disc", "square") and model.channels is Channels.RGB and len(model.templates) == 10
    assert model.about["settings"]["sources"] == ["my things", "walls"]
    assert str(output.parent.parent) not in json.dumps(dict(model.about))
    assert re.search(r"disc: \d+ positives of \d+ views; window of \d+ x \d+ cells\n", said)
    assert f"--detector 'hog:{output}'" in said
    for stage in ("reading objects", "round 2: mining", "calibrating"):
        assert re.search(rf"^{stage}: \d+ in \d+ s$", progress, re.MULTILINE), progress
    assert [file.name for file in output.parent.iterdir()] == [output.name]


def test_the_detector_is_taken_from_the_command_line(trained, tmp_path):
    result = thingmap(
        "detect", "sample:tabletop?frames=1", "--detector", f"hog:{trained[0]}", "-o", tmp_path / "d.json"
    )
    assert result.exit_code == 0, result.stderr


def test_ctrl_c_keeps_what_was_learned(trained, sources, tmp_path, monkeypatch):
    output = tmp_path / "model.npz"
    save = algorithm.save_checkpoint

    def save_and_stop(*arguments) -> None:
        save(*arguments)
        raise KeyboardInterrupt

    monkeypatch.setattr(algorithm, "save_checkpoint", save_and_stop)
    stopped = thingmap("train", "hog", *sources, "-o", output)
    assert stopped.exit_code == 130 and not output.exists()
    part = tmp_path / "model.npz.part"
    assert f"the same command goes on from the last round, which is in {part}" in stopped.stderr
    assert part.exists()
    monkeypatch.undo()

    other = refused(*sources, "--seed", 3, "-o", output)
    assert "model.npz.part" in other and "seed differ" in other and "remove it" in other
    done = thingmap("train", "hog", *sources, "-o", output)
    assert done.exit_code == 0 and "going on after round 1" in done.stderr and "round 1: mining" not in done.stderr
    assert output.read_bytes() == trained[0].read_bytes()
    assert not part.exists()


def test_before_the_first_round_nothing_is_kept(sources, tmp_path, monkeypatch):
    def stop(*_) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(algorithm, "gather", stop)
    result = thingmap("train", "hog", *sources, "-o", tmp_path / "model.npz")
    assert result.exit_code == 130 and "nothing is kept" in result.stderr
    assert not list(tmp_path.iterdir())


def test_mistakes(trained, sources, tmp_path):
    assert "existing one" in refused(*sources, "-o", trained[0])
    assert "ends in .npz" in refused(*sources, "-o", tmp_path / "model.pkl")
    (tmp_path / "folder.npz").mkdir()
    assert "a folder" in refused(*sources, "-o", tmp_path / "folder.npz")
    objects, nowhere = sources[:2], ("--background", tmp_path / "nowhere")
    assert "nowhere" in refused(*objects, *nowhere, "-o", tmp_path / "model.npz")
    assert "--channels rgb" in refused(*sources[:4], "--stride", 1, "-o", tmp_path / "model.npz")
    assert not (tmp_path / "model.npz").exists()
