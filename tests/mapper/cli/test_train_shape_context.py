"""`thingmap train shape-context`: from a folder of crops to a detector, and on after Ctrl-C."""

from __future__ import annotations

import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from thingmap.detectors.shape_context.model import load_model
from thingmap.detectors.shape_context.training import train as algorithm
from thingmap.mapper.cli.main import app

BACKGROUND = ("--background", "sample:tabletop", "--max-frames", 2, "--stride", 40)


def thingmap(*arguments: object):
    return CliRunner().invoke(app, [str(argument) for argument in arguments], prog_name="thingmap")


def refused(*arguments: object) -> str:
    result = thingmap("train", "shape-context", *arguments)
    assert result.exit_code == 2, result.output
    last = result.stderr.splitlines()[-1]
    assert last.startswith("error: ") and result.stderr.count("error:") == 1, result.stderr
    return last


def write_crops(folder: Path, labels: tuple[str, ...], count: int = 8, mask: bool = True) -> Path:
    """Crops of 72 x 72 pixels in the Washington layout: a disc or a square 1 m away, before a wall at 1.3 m."""
    rng = np.random.default_rng(len(labels))
    for label in labels:
        for k in range(count):
            name = folder / label / f"{label}_{k % 4}" / f"{label}_{k % 4}_1_{k}"
            name.parent.mkdir(parents=True, exist_ok=True)
            shape = np.zeros((72, 72), np.uint8)
            at = 12 + k % 3
            if label == "disc":
                cv2.circle(shape, (at + 22, 36), 22, 1, -1)
            else:
                shape[14:58, at : at + 44] = 1
            gray = np.where(shape > 0, 230, 90) + rng.integers(-3, 4, shape.shape)
            depth = np.where(shape > 0, 1000, 1300) + rng.integers(-2, 3, shape.shape)
            cv2.imwrite(f"{name}_crop.png", np.repeat(gray[..., None], 3, axis=2).astype(np.uint8))
            cv2.imwrite(f"{name}_depthcrop.png", depth.astype(np.uint16))
            if mask:
                cv2.imwrite(f"{name}_maskcrop.png", 255 * shape)
    return folder


@pytest.fixture(scope="module")
def objects(tmp_path_factory) -> tuple[object, ...]:
    return ("--objects", write_crops(tmp_path_factory.mktemp("pictures") / "my things", ("disc", "square")))


@pytest.fixture(scope="module")
def trained(objects, tmp_path_factory) -> tuple[Path, str, str]:
    output = tmp_path_factory.mktemp("trained") / "new" / "my model.npz"
    result = thingmap("train", "shape-context", *objects, *BACKGROUND, "-o", output)
    assert result.exit_code == 0, result.stderr
    return output, result.stdout, result.stderr


def test_a_model_and_what_is_said_of_it(trained):
    output, said, progress = trained
    model = load_model(output)
    assert model.classes == ("disc", "square")
    assert model.about["settings"]["sources"] == ["my things", "sample:tabletop"]
    assert str(output.parent.parent) not in json.dumps(dict(model.about))
    assert re.search(
        r"disc: \d+ descriptors of 6 views, by which [\d.]+ % of pairs(.|\n)*radius of descriptors: \d+", said
    )
    assert re.search(r"calibrated with \d+ proposals of frames for background\n", said)
    assert f"--detector 'shape-context:{output}'" in said
    for stage in ("edges of held-out objects", "disc: edges", "square: radius", "calibrating"):
        assert re.search(rf"^{stage}: \d+ in \d+ s$", progress, re.MULTILINE), progress
    assert [file.name for file in output.parent.iterdir()] == [output.name]


def test_the_detector_is_taken_from_the_command_line(trained, tmp_path):
    spec = f"shape-context:{trained[0]}"
    result = thingmap("detect", "sample:tabletop?frames=1", "--detector", spec, "-o", tmp_path / "d.json")
    assert result.exit_code == 0, result.stderr


def test_without_background_it_is_said_what_stands_for_it(objects, tmp_path):
    result = thingmap("train", "shape-context", *objects, "-o", tmp_path / "model.npz")
    assert result.exit_code == 0, result.stderr
    assert "4 objects of other classes for background; --background gives truer probabilities" in result.stdout


def test_ctrl_c_keeps_what_was_learned(trained, objects, tmp_path, monkeypatch):
    output = tmp_path / "model.npz"
    save = algorithm.save_checkpoint

    def save_and_stop(*arguments) -> None:
        save(*arguments)
        raise KeyboardInterrupt

    monkeypatch.setattr(algorithm, "save_checkpoint", save_and_stop)
    command = ("train", "shape-context", *objects, *BACKGROUND, "-o", output)
    stopped = thingmap(*command)
    part = tmp_path / "model.npz.part"
    assert stopped.exit_code == 130 and not output.exists() and part.exists()
    assert f"the same command goes on from the last class, which is in {part}" in stopped.stderr
    monkeypatch.undo()

    other = refused(*objects, *BACKGROUND, "--seed", 3, "-o", output)
    assert "model.npz.part" in other and "seed differ" in other and "remove it" in other
    done = thingmap(*command)
    assert done.exit_code == 0 and "disc: radius" not in done.stderr and "square: edges" in done.stderr
    assert output.read_bytes() == trained[0].read_bytes()
    assert not part.exists()


def test_before_the_first_class_nothing_is_kept(objects, tmp_path, monkeypatch):
    def stop(*_) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(algorithm, "gather", stop)
    result = thingmap("train", "shape-context", *objects, "-o", tmp_path / "model.npz")
    assert result.exit_code == 130 and "before the first class was done; nothing is kept" in result.stderr
    assert not list(tmp_path.iterdir())


def test_views_that_lack_something_are_told(objects, tmp_path):
    more = write_crops(tmp_path / "without masks", ("disc", "square"), 4, mask=False)
    result = thingmap("train", "shape-context", *objects, "--objects", more, "-o", tmp_path / "model.npz")
    assert result.exit_code == 0 and "8 with no mask of the object (" in result.stderr, result.stderr


def test_mistakes(trained, objects, tmp_path):
    output = ("-o", tmp_path / "model.npz")
    assert "existing one" in refused(*objects, "-o", trained[0])
    assert "ends in .npz" in refused(*objects, "-o", tmp_path / "model.pkl")
    assert "nowhere" in refused(*objects, "--background", tmp_path / "nowhere", *output)
    maskless = write_crops(tmp_path / "without masks", ("disc", "square"), 4, mask=False)
    assert "no mask of the object; give views with depth and a mask" in refused("--objects", maskless, *output)
    alone = write_crops(tmp_path / "alone", ("disc",))
    assert "'disc' alone: there is nothing to tell it from" in refused("--objects", alone, *output)
    assert not (tmp_path / "model.npz").exists()
